"""Train the generative restorer on what the deterministic one is trained on; export it for 1, 2, 4 and 8 steps.

python -m shipshape_lab.generative.train --data runs/data --out runs/generative

Leaves OUT/flow_N.onnx: planes, features and noise to the outputs of inpainting.onnx. `generative.bundle` makes a
bundle of one.
"""

from pathlib import Path

import numpy as np
import torch

from shipshape import raster
from shipshape_lab.generative import flow
from shipshape_lab.generative.net import FEATURES, PLANES, FlowNet
from shipshape_lab.training import arguments, export, loop
from shipshape_lab.training.examples import Examples
from shipshape_lab.training.train_inpainting import guess, to_item

EPOCHS = 5  # about half an hour on one core
OUTPUTS = ["occupancy", "top", "bottom", "offset", "classes"]


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, and export."""
    args = arguments.parse(__doc__, argv, epochs=EPOCHS)
    examples = Examples.read(args.data, "train")

    def draw(i: int, rng: np.random.Generator) -> dict:
        example = examples.drawn(i, rng)
        return to_item(example, guess(example, rng)) | flow.moment(rng)

    torch.manual_seed(args.seed)
    net = FlowNet(len(examples.catalogue) + 1, raster.aligned_frame(1.0).edges)
    data, schedule = loop.Drawn(examples.indices, draw, args.seed), loop.Schedule(args.epochs, seed=args.seed)
    loop.train(net, data, flow.loss_of, schedule, args.out / "checkpoints/flow.pt")
    write(net, args.out)


def write(net: FlowNet, folder: Path) -> None:
    """Export to flow_1.onnx, flow_2.onnx, flow_4.onnx and flow_8.onnx, the steps unrolled."""
    planes, features = torch.rand(1, PLANES, 32, 64), torch.rand(1, FEATURES)
    inputs = {"planes": planes, "features": features, "noise": torch.rand(1, *flow.NOISE_SHAPE)}
    for steps in flow.STEPS:
        export.export(flow.Sampler(net, steps), inputs, OUTPUTS, folder / f"flow_{steps}.onnx")


if __name__ == "__main__":
    main()
