"""Train the five image methods of the paper's first experiment on ModelNet40 shapes; stopped, it goes on.

    python -m shipshape_lab.modelnet.train --shapes ../shared/data/modelnet --out runs/modelnet

One network a method, for all masks and losses. The paper's methods use its network (GreyNet) and loss, as on
vessels; `best` uses the network of that preset on a square image. Writes OUT/METHOD.onnx and OUT/METHOD.json.
The share under which a grey pixel counts as empty is the one with the lowest CD-L1 on validation shapes.
"""

import argparse
import logging
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import nn
from tqdm import tqdm

from shipshape.onnx_model import OnnxModel
from shipshape.types import ImageMethod, ReferenceBox
from shipshape_lab import metrics
from shipshape_lab.commit import code_commit
from shipshape_lab.modelnet import examples, masks
from shipshape_lab.modelnet.examples import Masked
from shipshape_lab.modelnet.methods import BEST, METHODS, GreyMethod, layers_frame
from shipshape_lab.modelnet.record import Record
from shipshape_lab.modelnet.shapes import KINDS, Shape, Split, read_shapes
from shipshape_lab.training import export, loop, train_grey, train_inpainting
from shipshape_lab.training.nets import GreyNet, InpaintingNet

EPOCHS = {BEST: 10}
GREY_EPOCHS = 24
EMPTY_BELOW = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4)  # candidates


class SquareInpaintingNet(InpaintingNet):
    """The network of preset `best` for an image of 64 x 64 cells; its class head knows the kinds of shapes."""

    def __init__(self) -> None:
        super().__init__(len(KINDS), layers_frame(ReferenceBox(1.0, 1.0, 1.0)).edges)
        self.classify = nn.Sequential(
            nn.Conv2d(self.inject.out_features, 32, 1),
            nn.ReLU(),
            nn.Flatten(),
            nn.Dropout(0.2),
            nn.Linear(32 * 8 * 8, len(KINDS)),
        )


def train_method(name: str, shapes: list[Shape], args: argparse.Namespace) -> nn.Module:
    """Train one network, or go on with it, and export it."""
    drawn = examples.schedule(shapes)
    item = examples.layers_item if name == BEST else partial(examples.grey_item, method=ImageMethod(name))
    data = loop.Drawn(np.arange(len(drawn)), lambda i, rng: item(Masked.drawn(drawn[i], rng)), args.seed)
    torch.manual_seed(args.seed)
    net = SquareInpaintingNet() if name == BEST else GreyNet()
    loss_of = train_inpainting.loss_of if name == BEST else train_grey.loss_of
    plan = loop.Schedule(epochs_of(name, args), seed=args.seed)
    return loop.train(net, data, loss_of, plan, args.out / f"checkpoints/{name}.pt")


def epochs_of(name: str, args: argparse.Namespace) -> int:
    """How long a method is trained."""
    return args.epochs or EPOCHS.get(name, GREY_EPOCHS)


def write(net: nn.Module, folder: Path, name: str) -> None:
    """Export to NAME.onnx."""
    if name == BEST:
        inputs = {"planes": torch.rand(1, 18, 64, 64), "features": torch.rand(1, 3)}
        export.export(net, inputs, ["occupancy", "top", "bottom", "offset", "classes"], folder / f"{name}.onnx")
    else:
        train_grey.write(net, folder, name)


def fit_empty_below(method: ImageMethod, model: OnnxModel, shapes: list[Shape], seed: int) -> float:
    """The candidate with the lowest mean CD-L1 over validation shapes, each under every mask at half loss."""
    sums = np.zeros(len(EMPTY_BELOW))
    for shape in tqdm(shapes, desc=f"threshold of {method}", leave=False, mininterval=2.0):
        truth = metrics.CompleteSurface(shape.points, shape.extent)
        for mask in masks.MASKS:
            left = shape.points[masks.kept(shape.points, mask, 50, masks.chance(shape.name, mask, 50, seed))]
            for i, share in enumerate(EMPTY_BELOW):
                restored = GreyMethod(method, model, share).restore(left, shape.pose)
                sums[i] += metrics.chamfer_l1(truth.nearest(restored.points))
    return EMPTY_BELOW[int(sums.argmin())]


def main(argv: list[str] | None = None) -> None:
    """Command line: every method that has no record yet."""
    args = _parser().parse_args(argv)
    torch.set_num_threads(args.threads)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", datefmt="%H:%M:%S")
    shapes, validation = examples.split_validation(read_shapes(args.shapes, Split.TRAIN))
    for name in args.method or METHODS:
        if (args.out / f"{name}.json").exists():
            logging.info("%s is trained already", name)
            continue
        write(train_method(name, shapes, args), args.out, name)
        model, empty_below = OnnxModel(args.out / f"{name}.onnx"), 0.0
        if name != BEST:
            empty_below = fit_empty_below(ImageMethod(name), model, validation, args.seed)
        Record(empty_below, len(shapes), epochs_of(name, args), args.seed, code_commit()).write(args.out, name)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--shapes", type=Path, required=True, help="folder of the ModelNet40 point files and lists"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for networks, records and checkpoints/")
    parser.add_argument("--method", choices=METHODS, action="append", help="train only this one; may be repeated")
    parser.add_argument("--epochs", type=int, default=0, help=f"default {GREY_EPOCHS}, for best {EPOCHS[BEST]}")
    parser.add_argument("--seed", type=int, default=1, help="seed of initialisation, draws and masks (default 1)")
    parser.add_argument("--threads", type=int, default=1, help="CPU threads (default 1)")
    return parser


if __name__ == "__main__":
    main()
