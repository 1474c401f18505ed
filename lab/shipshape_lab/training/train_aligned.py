"""Train the look in the roughly aligned frame: what to correct, bow or stern, and the class.

python -m shipshape_lab.training.train_aligned --data runs/data --out runs/default
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
from shipshape_lab.training.nets import AlignedNet
from shipshape_lab.training.poses import disturbed

EPOCHS = 9


def guess(example: Example, rng: np.random.Generator) -> Pose:
    """A pose that the network may be handed: disturbed, and in half of the cases with bow and stern swapped."""
    pose = disturbed(example.pose, rng, wide=rng.random() < 0.5)
    if example.contact.sensor_height is None:
        x, y, _ = pose.origin_level
        pose = Pose(pose.heading, (x, y, float(example.contact.points_level[:, 2].min())), pose.size)
    return pose.turned(math.pi) if rng.random() < 0.5 else pose


def to_item(example: Example, pose: Pose) -> dict:
    """The network's inputs and targets for one example seen in the frame of `pose`."""
    planes, features = alignment.look_inputs(example.contact.points_level, pose)
    truth, length = example.pose, pose.size.length
    step = np.subtract(truth.origin_level, pose.origin_level)
    step[:2] = step[:2] @ frames.R_level_vessel(pose.heading)
    size = np.array([truth.size.length, truth.size.beam, truth.size.height])
    return {
        "planes": planes,
        "features": features,
        "turn": np.float32(frames.wrap_half_turn(truth.heading - pose.heading)),
        "flip": np.float32(abs(frames.wrap_angle(truth.heading - pose.heading)) > math.pi / 2),
        "shift": (step / length).astype(np.float32),
        "size": np.log(size / length).astype(np.float32),
        "label": example.label,
    }


def loss_of(net: nn.Module, batch: dict[str, Tensor]) -> Tensor:
    """Laplace likelihood of the turn, robust errors of shift and size, cross-entropies of bow and class."""
    turn, flip, shift, size, classes = (out.float() for out in net(batch["planes"], batch["features"]))
    error = (turn[:, 0] - batch["turn"]).abs()
    log_spread = turn[:, 1]
    robust, functional = nn.functional.smooth_l1_loss, nn.functional
    return (
        0.3 * (error * torch.exp(-log_spread) + log_spread).mean()
        + 4.0 * error.mean()
        + 4.0 * robust(shift, batch["shift"], beta=0.01)
        + 2.0 * robust(size, batch["size"], beta=0.03)
        + functional.binary_cross_entropy_with_logits(flip[:, 0], batch["flip"])
        + 0.5 * functional.cross_entropy(classes, batch["label"], label_smoothing=0.02)
    )


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, and export aligned.onnx."""
    args = arguments.parse(__doc__, argv, epochs=EPOCHS)
    examples = Examples.read(args.data, "train")

    def draw(i: int, rng: np.random.Generator) -> dict:
        example = examples.drawn(i, rng)
        return to_item(example, guess(example, rng))

    def draws(seed: int) -> loop.Drawn:
        return loop.Drawn(examples.indices, draw, seed)

    torch.manual_seed(args.seed)
    net = AlignedNet(len(examples.catalogue) + 1)
    schedule = loop.Schedule(args.epochs, seed=args.seed)
    net = loop.train_for_int8(net, draws, loss_of, schedule, args.out / "checkpoints/aligned.pt")
    write(net, args.out / "bundle")


def write(net: nn.Module, folder: Path) -> None:
    """Export to aligned.onnx."""
    inputs = {"planes": torch.rand(1, 9, 32, 64), "features": torch.rand(1, 3)}
    export.export(net, inputs, ["turn", "flip", "shift", "size", "classes"], folder / "aligned.onnx")


if __name__ == "__main__":
    main()
