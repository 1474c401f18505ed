"""Train the paper's inpainting for one image method: grey image of the cluster to that of the whole vessel.

python -m shipshape_lab.training.train_grey --method full_side --data runs/data --out runs/default
"""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from shipshape import raster
from shipshape.stages import projection
from shipshape.types import ImageMethod, ReferenceBox
from shipshape_lab.training import arguments, export, loop
from shipshape_lab.training.examples import Example, Examples
from shipshape_lab.training.nets import GreyNet
from shipshape_lab.training.poses import paper_pose

EPOCHS = 2


def to_item(example: Example, method: ImageMethod, boxes: list[ReferenceBox]) -> dict:
    """Grey images in [0, 1] of the cluster and of the complete surface, in the paper's pose."""
    pose = paper_pose(example, boxes)
    frame = projection.paper_frame(method, pose.size, max(box.length for box in boxes))
    images = {}
    for name, points in (("image", example.contact.points_level), ("whole", example.surface_level)):
        layers = projection.project(points, pose, frame)
        grey = raster.to_grey(layers.count > 0, layers.top, frame)
        images[name] = grey.transpose(2, 0, 1).astype(np.float32) / 255
    return images


def loss_of(net: nn.Module, batch: dict[str, Tensor]) -> Tensor:
    """Absolute error, half of it over the filled pixels, so that the many empty ones do not drown them."""
    error = (net(batch["image"]).float() - batch["whole"]).abs()
    filled = (batch["whole"] > 0).float()
    return error.mean() + (error * filled).sum() / (filled.sum() + 1.0)


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, and export inpainting_METHOD.onnx."""
    args = arguments.parse(__doc__, argv, epochs=EPOCHS, method=list(ImageMethod))
    method = ImageMethod(args.method)
    examples = Examples.read(args.data, "train", catalogue_only=True)
    boxes = examples.boxes
    data = loop.Drawn(examples.indices, lambda i, rng: to_item(examples.drawn(i, rng), method, boxes), args.seed)
    torch.manual_seed(args.seed)
    schedule = loop.Schedule(args.epochs, seed=args.seed)
    name = f"inpainting_{method}"
    net = loop.train(GreyNet(), data, loss_of, schedule, args.out / f"checkpoints/{name}.pt")
    write(net, args.out / "bundle", name)


def write(net: nn.Module, folder: Path, name: str) -> None:
    """Export to NAME.onnx."""
    export.export(net, {"image": torch.rand(1, 3, 64, 64)}, ["filled"], folder / f"{name}.onnx")


if __name__ == "__main__":
    main()
