"""Train the look along the line of sight: heading modulo pi, middle and size of the unaligned cluster.

python -m shipshape_lab.training.train_sight --data runs/data --out runs/default
"""

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from shipshape import frames, sight
from shipshape.stages import heading
from shipshape_lab.training import arguments, export, loop
from shipshape_lab.training.examples import Example, Examples
from shipshape_lab.training.nets import SightNet

EPOCHS = 5


def to_item(example: Example) -> dict:
    """The network's inputs and targets for one example."""
    frame = sight.sight_frame(example.contact)
    seen = heading.sight_image(sight.to_sight(example.contact.points_level, frame), frame)
    axis = 2.0 * (example.pose.heading - frame.bearing)
    step = np.subtract(example.pose.origin_level[:2], frame.origin_level[:2]) @ frames.R_level_vessel(
        frame.bearing
    )
    size = example.pose.size
    return {
        "planes": seen.planes,
        "features": seen.features,
        "axis": np.array([math.sin(axis), math.cos(axis)], np.float32),
        "shift": (step / seen.half_extent).astype(np.float32),
        "size": np.log([size.length, size.beam, size.height]).astype(np.float32),
    }


def loss_of(net: nn.Module, batch: dict[str, Tensor]) -> Tensor:
    """Squared error of the doubled angle's vector, and robust errors of middle and size."""
    axis, shift, size = (out.float() for out in net(batch["planes"], batch["features"]))
    robust = nn.functional.smooth_l1_loss
    return (
        nn.functional.mse_loss(axis, batch["axis"])
        + 0.5 * robust(shift, batch["shift"], beta=0.05)
        + 0.5 * robust(size, batch["size"], beta=0.05)
    )


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, and export sight.onnx."""
    args = arguments.parse(__doc__, argv, epochs=EPOCHS)
    examples = Examples.read(args.data, "train")

    def draws(seed: int) -> loop.Drawn:
        return loop.Drawn(examples.indices, lambda i, rng: to_item(examples.drawn(i, rng)), seed)

    schedule = loop.Schedule(args.epochs, seed=args.seed)
    torch.manual_seed(args.seed)
    net = loop.train_for_int8(SightNet(), draws, loss_of, schedule, args.out / "checkpoints/sight.pt")
    write(net, args.out / "bundle")


def write(net: nn.Module, folder: Path) -> None:
    """Export to sight.onnx."""
    inputs = {"planes": torch.rand(1, 3, 64, 64), "features": torch.rand(1, 4)}
    export.export(net, inputs, ["axis", "shift", "size"], folder / "sight.onnx")


if __name__ == "__main__":
    main()
