"""Train inpainting of preset `best`: aligned layers of the cluster to layers of the whole vessel, and the class.

python -m shipshape_lab.training.train_inpainting --data runs/data --out runs/default
"""

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from shipshape import raster
from shipshape.stages import inpainting, projection
from shipshape.types import Pose
from shipshape_lab.training import arguments, export, loop
from shipshape_lab.training.examples import Example, Examples
from shipshape_lab.training.nets import InpaintingNet
from shipshape_lab.training.poses import disturbed

EPOCHS = 14
WRONG_BOW = 0.01  # share of poses with bow and stern swapped, about what bow_stern leaves


def guess(example: Example, rng: np.random.Generator) -> Pose:
    """A pose as the stage bow_stern may hand it on."""
    pose = disturbed(example.pose, rng, wide=False)
    return pose.turned(math.pi) if rng.random() < WRONG_BOW else pose


def to_item(example: Example, pose: Pose) -> dict:
    """Inputs of the network, and the layers of the complete surface in the same frame."""
    points = example.contact.points_level
    frame = raster.aligned_frame(pose.size.length)
    measured = projection.project(points, pose, frame)
    whole = projection.project(example.surface_level, pose, frame)
    planes, features = inpainting.network_inputs(measured, pose, len(points))
    return {
        "planes": planes,
        "features": features,
        "occupied": (whole.count > 0).astype(np.float32),
        "measured": (measured.count > 0).astype(np.float32),
        "top": np.clip(whole.top, 0, 1),
        "bottom": np.clip(whole.bottom, 0, 1),
        "offset": whole.offset,
        "label": example.label,
    }


def loss_of(net: nn.Module, batch: dict[str, Tensor]) -> Tensor:
    """Occupancy (cross-entropy and Dice), heights and offsets where there is surface, and the class."""
    occupancy, top, bottom, offset, classes = (out.float() for out in net(batch["planes"], batch["features"]))
    there = batch["occupied"]
    cells = there.sum() + 1.0
    occupancy = occupancy.clamp(1e-5, 1 - 1e-5)
    entropy = -(there * occupancy.log() + (1 - there) * (1 - occupancy).log()).mean()
    dice = 1 - 2 * (occupancy * there).sum() / (occupancy.sum() + cells)
    heights = ((top - batch["top"]).abs() + (bottom - batch["bottom"]).abs()) * there
    offsets = (offset - batch["offset"]).abs().sum(dim=1) * there
    return (
        3.0 * entropy
        + 0.5 * dice
        + 12.0 * heights.sum() / cells
        + 0.5 * offsets.sum() / cells
        + 0.5 * nn.functional.cross_entropy(classes, batch["label"], label_smoothing=0.02)
    )


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, and export inpainting.onnx."""
    args = arguments.parse(__doc__, argv, epochs=EPOCHS)
    examples = Examples.read(args.data, "train")

    def draw(i: int, rng: np.random.Generator) -> dict:
        example = examples.drawn(i, rng)
        return to_item(example, guess(example, rng))

    def draws(seed: int) -> loop.Drawn:
        return loop.Drawn(examples.indices, draw, seed)

    torch.manual_seed(args.seed)
    net = InpaintingNet(len(examples.catalogue) + 1, raster.aligned_frame(1.0).edges)
    schedule = loop.Schedule(args.epochs, seed=args.seed)
    net = loop.train_for_int8(net, draws, loss_of, schedule, args.out / "checkpoints/inpainting.pt")
    write(net, args.out / "bundle")


def write(net: nn.Module, folder: Path) -> None:
    """Export to inpainting.onnx."""
    inputs = {"planes": torch.rand(1, 18, 32, 64), "features": torch.rand(1, 3)}
    export.export(net, inputs, ["occupancy", "top", "bottom", "offset", "classes"], folder / "inpainting.onnx")


if __name__ == "__main__":
    main()
