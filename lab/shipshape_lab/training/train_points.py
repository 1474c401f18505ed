"""Train the first look at the points along the line of sight: class, heading, bow, middle and size at once.

python -m shipshape_lab.training.train_points --data runs/data --out runs/default
"""

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from shipshape import first_look, frames, sight
from shipshape_lab.training import arguments, export, loop
from shipshape_lab.training.examples import Example, Examples
from shipshape_lab.training.nets import PointsNet

EPOCHS = 8
INPUTS = ("near", "members", "far", "centres", "features")


def to_item(example: Example) -> dict:
    """The network's inputs, filled up to a fixed size, and its targets for one example."""
    points = example.contact.points_level
    frame = sight.sight_frame(example.contact)
    turned = example.pose.heading - frame.bearing
    rotation = frames.R_level_vessel(frame.bearing)
    step = np.subtract(example.pose.origin_level[:2], frame.origin_level[:2]) @ rotation
    size = example.pose.size
    return {
        **filled(first_look.network_inputs(sight.to_sight(points, frame), frame)),
        "heading": np.array([math.cos(turned), math.sin(turned)], np.float32),
        "step": (step / first_look.UNIT).astype(np.float32),
        "size": np.log([size.length, size.beam, size.height]).astype(np.float32),
        "label": example.label,
    }


def filled(inputs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Groups repeated until there are as many as at most: batches are of one shape, and no maximum changes."""
    groups, wholes = (np.arange(most) for most in first_look.CENTRES)
    members = inputs["members"].reshape(-1, first_look.NEIGHBOURS)
    wholes = wholes % len(members)
    return {
        "near": inputs["near"][:, groups % inputs["near"].shape[1]],
        "members": members[wholes].reshape(-1),
        "far": inputs["far"][:, wholes],
        "centres": inputs["centres"][:, wholes],
        "features": inputs["features"],
    }


def loss_of(net: nn.Module, batch: dict[str, Tensor]) -> Tensor:
    """Class, the doubled angle as a vector, bow along the true axis, middle in lengths, log size."""
    axis, shift, size, bow, classes = (out.float() for out in net(*(batch[name] for name in INPUTS)))
    cosine, sine = batch["heading"].T
    doubled = torch.stack([2 * sine * cosine, cosine**2 - sine**2], dim=1)
    ahead = 2 * (bow * batch["heading"]).sum(dim=1)
    lengths = batch["size"][:, :1].exp() / first_look.UNIT
    robust = nn.functional.smooth_l1_loss
    return (
        nn.functional.cross_entropy(classes, batch["label"], label_smoothing=0.02)
        + nn.functional.mse_loss(axis, doubled)
        + 0.3 * nn.functional.softplus(-ahead).mean()
        + robust(shift / lengths, batch["step"] / lengths, beta=0.05)
        + 0.5 * robust(size, batch["size"], beta=0.05)
    )


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, and export points.onnx."""
    args = arguments.parse(__doc__, argv, epochs=EPOCHS)
    examples = Examples.read(args.data, "train")

    def draws(seed: int) -> loop.Drawn:
        return loop.Drawn(examples.indices, lambda i, rng: to_item(examples.drawn(i, rng)), seed)

    torch.manual_seed(args.seed)
    net = PointsNet(len(examples.catalogue) + 1)
    schedule = loop.Schedule(args.epochs, seed=args.seed)
    net = loop.train_for_int8(net, draws, loss_of, schedule, args.out / "checkpoints/points.pt")
    write(net, args.out / "bundle")


def write(net: nn.Module, folder: Path) -> None:
    """Export to points.onnx."""
    groups, wholes = (most - 1 for most in first_look.CENTRES)  # any number; most make the bounds of `members`
    k = first_look.NEIGHBOURS
    inputs = {
        "near": torch.rand(1, 6, groups, k),
        "members": torch.arange(wholes * k)[None] % groups,
        "far": torch.rand(1, 3, wholes, k),
        "centres": torch.rand(1, 3, wholes, 1),
        "features": torch.rand(1, 3),
    }
    free = {"near": {2: "groups"}, "members": {1: "members"}, "far": {2: "wholes"}, "centres": {2: "wholes"}}
    export.export(net, inputs, ["axis", "shift", "size", "bow", "classes"], folder / "points.onnx", free=free)


if __name__ == "__main__":
    main()
