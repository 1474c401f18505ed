"""Train the look at the points themselves in the aligned frame: bow or stern, and the class.

python -m shipshape_lab.training.train_points --data runs/data --out runs/default
"""

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from shipshape import alignment, frames
from shipshape.types import Pose
from shipshape_lab.training import arguments, export, loop
from shipshape_lab.training.examples import Example, Examples
from shipshape_lab.training.nets import PointsNet
from shipshape_lab.training.poses import disturbed

EPOCHS = 7
POINTS = 256  # of every example, so that they fill a batch; the network itself takes any number
WIDE = 0.2  # share of poses as wrong as those of the first look


def guess(example: Example, rng: np.random.Generator) -> Pose:
    """A pose as the aligned looks may leave it, and in half of the cases with bow and stern swapped."""
    pose = disturbed(example.pose, rng, wide=rng.random() < WIDE)
    return pose.turned(math.pi) if rng.random() < 0.5 else pose


def to_item(example: Example, pose: Pose, rng: np.random.Generator) -> dict:
    """The network's inputs and targets for one example seen in the frame of `pose`."""
    points = example.contact.points_level
    planes, features = alignment.point_inputs(rng.permutation(points), pose)
    filled = np.arange(POINTS) % planes.shape[2]  # repeated points change no maximum
    return {
        "points": planes[:, :, filled],
        "features": features,
        "flip": np.float32(abs(frames.wrap_angle(example.pose.heading - pose.heading)) > math.pi / 2),
        "label": example.label,
    }


def loss_of(net: nn.Module, batch: dict[str, Tensor]) -> Tensor:
    """Cross-entropies of bow and class."""
    flip, classes = (out.float() for out in net(batch["points"], batch["features"]))
    return 0.5 * nn.functional.binary_cross_entropy_with_logits(
        flip[:, 0], batch["flip"]
    ) + nn.functional.cross_entropy(classes, batch["label"], label_smoothing=0.02)


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, and export points.onnx."""
    args = arguments.parse(__doc__, argv, epochs=EPOCHS)
    examples = Examples.read(args.data, "train")

    def draw(i: int, rng: np.random.Generator) -> dict:
        example = examples.drawn(i, rng)
        return to_item(example, guess(example, rng), rng)

    def draws(seed: int) -> loop.Drawn:
        return loop.Drawn(examples.indices, draw, seed)

    torch.manual_seed(args.seed)
    net = PointsNet(len(examples.catalogue) + 1)
    schedule = loop.Schedule(args.epochs, seed=args.seed)
    net = loop.train_for_int8(net, draws, loss_of, schedule, args.out / "checkpoints/points.pt")
    write(net, args.out / "bundle")


def write(net: nn.Module, folder: Path) -> None:
    """Export to points.onnx."""
    inputs = {"points": torch.rand(1, 6, 1, 300), "features": torch.rand(1, 5)}
    export.export(net, inputs, ["flip", "classes"], folder / "points.onnx", free={"points": {3: "points"}})


if __name__ == "__main__":
    main()
