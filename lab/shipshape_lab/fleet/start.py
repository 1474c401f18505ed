"""Take up where a finished bundle ended: its weights as the first checkpoint of networks for other vessels.

    python -m shipshape_lab.fleet.start --from models --data work/data --out work/networks

What a hull looks like from one side is much the same in every fleet; only the heads that name classes start anew.
A bundle holds no batch norms: they are folded into the convolutions, and these are rounded to int8. So weights are
brought back to float32, and each norm is set to what undoes it on the data that training will show.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.utils.data import default_collate

from shipshape import raster
from shipshape.types import ImageMethod
from shipshape_lab.fleet.plan import PLANS
from shipshape_lab.training import loop, train_aligned, train_grey, train_inpainting, train_points
from shipshape_lab.training.examples import Example, Examples
from shipshape_lab.training.nets import AlignedNet, GreyNet, InpaintingNet, PointsNet

ITEMS = 256  # examples that the batch norms are set on
NEW_HEADS = ("classes", "classify")
RATE = 7e-4  # peak; a third of what training from nothing takes, so that little of the start is lost
KINDS = {"Conv": nn.Conv2d, "Gemm": nn.Linear}
Layers = dict[type, list[tuple[np.ndarray, np.ndarray]]]


def layers_of(path: Path) -> Layers:
    """Weights and biases of an ONNX file's convolutions and of its linear layers, as float32, in its order."""
    graph = onnx.load(path).graph
    arrays = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    for node in graph.node:
        given = [arrays.get(name) for name in node.input]
        if node.op_type == "DequantizeLinear" and given[0] is not None:
            arrays[node.output[0]] = _dequantised(*given)
        elif node.op_type == "Identity" and given[0] is not None:  # layers of one content share it
            arrays[node.output[0]] = given[0]
    found: Layers = {kind: [] for kind in KINDS.values()}
    for node in graph.node:
        if node.op_type in KINDS:
            found[KINDS[node.op_type]].append((arrays[node.input[1]], arrays[node.input[2]]))
    return found


def _dequantised(whole: np.ndarray, scale: np.ndarray, zero: np.ndarray) -> np.ndarray:
    spread = [-1] + [1] * (whole.ndim - 1) if scale.ndim else []
    return (whole.astype(np.float32) - zero.astype(np.float32).reshape(spread)) * scale.reshape(spread)


def take_up(net: nn.Module, layers: Layers, inputs: Sequence[Tensor]) -> None:
    """Give a fresh network the weights of an exported one; on `inputs` both then compute the same.

    Raises:
        ValueError: the file is of another kind of network.
    """
    called = _in_order(net.eval(), inputs)
    names = {module: name for name, module in net.named_modules()}
    left, shifts = {kind: list(found) for kind, found in layers.items()}, {}
    bias = torch.zeros(0)  # of the layer before
    for module in called:
        if isinstance(module, nn.BatchNorm2d):
            shifts[module] = bias
        elif not names[module].startswith(NEW_HEADS):
            weight, bias = _next_like(module, left[type(module)], names[module])
            module.weight.data.copy_(weight)
            if module.bias is not None:
                module.bias.data.copy_(bias)
    _set_norms(net, shifts, inputs)


def _next_like(module: nn.Module, left: list[tuple[np.ndarray, np.ndarray]], name: str) -> tuple[Tensor, Tensor]:
    """The first layer left of the module's shape: branches may be in another order, layers of one branch never."""
    shape = tuple(module.weight.shape)
    for place, (weight, bias) in enumerate(left):
        if weight.shape == shape:
            del left[place]
            return torch.tensor(weight), torch.tensor(bias)
    raise ValueError(
        f"expected a network with a layer {name} of shape {shape}, got none: start from another bundle"
    )


def _in_order(net: nn.Module, inputs: Sequence[Tensor]) -> list[nn.Module]:
    called: list[nn.Module] = []
    kinds = (nn.Conv2d, nn.Linear, nn.BatchNorm2d)
    hooks = [
        module.register_forward_hook(lambda module, *_: called.append(module))
        for module in net.modules()
        if isinstance(module, kinds)
    ]
    _run(net, inputs, hooks)
    return called


def _set_norms(net: nn.Module, shifts: dict[nn.Module, Tensor], inputs: Sequence[Tensor]) -> None:
    """Make every norm x + shift on these inputs, in training and in evaluation mode alike."""

    def undo(norm: nn.Module, given: tuple[Tensor]) -> None:
        mean, variance = given[0].mean(dim=(0, 2, 3)), given[0].var(dim=(0, 2, 3), unbiased=False)
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(variance)
        norm.weight.data.copy_((variance + norm.eps).sqrt())
        norm.bias.data.copy_(shifts[norm] + mean)

    _run(net, inputs, [norm.register_forward_pre_hook(undo) for norm in shifts])


def _run(net: nn.Module, inputs: Sequence[Tensor], hooks: list) -> None:
    with torch.no_grad():
        net(*inputs)
    for hook in hooks:
        hook.remove()


def starts(examples: Examples) -> dict[str, tuple[nn.Module, Callable[[Example, np.random.Generator], dict]]]:
    """The networks that a bundle can start, by name: freshly made, and how an example becomes their input."""
    classes = len(examples.catalogue) + 1
    edges = raster.aligned_frame(1.0).edges
    found = {
        "aligned": (AlignedNet(classes), lambda e, rng: train_aligned.to_item(e, train_aligned.guess(e, rng))),
        "points": (PointsNet(classes), lambda e, rng: train_points.to_item(e)),
        "inpainting": (
            InpaintingNet(classes, edges),
            lambda e, rng: train_inpainting.to_item(e, train_inpainting.guess(e, rng)),
        ),
    }
    for method in ImageMethod:
        found[f"inpainting_{method}"] = (
            GreyNet(),
            lambda e, rng, method=method: train_grey.to_item(e, method, examples.boxes),
        )
    return found


def main(argv: list[str] | None = None) -> None:
    """Write the first checkpoint of every network that the bundle can start."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--from", type=Path, required=True, dest="bundle", help="folder of the bundle")
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--out", type=Path, required=True, help="folder for checkpoints/")
    parser.add_argument("--plan", choices=sorted(PLANS), default="quick", help="whose epochs (default quick)")
    args = parser.parse_args(argv)
    torch.set_num_threads(1)
    examples, known = (Examples.read(args.data, "train", catalogue_only=only) for only in (False, True))
    for name, (net, to_item) in starts(known).items():
        own = known if isinstance(net, GreyNet) else examples
        rng = np.random.default_rng(0)
        chosen = rng.choice(own.indices, min(ITEMS, len(own)), replace=False)
        batch = default_collate([to_item(own.drawn(int(i), rng), rng) for i in chosen])
        inputs = [batch[key] for key in ("planes", *train_points.INPUTS, "image") if key in batch]
        take_up(net, layers_of(args.bundle / f"{name}.onnx"), inputs)
        schedule = loop.Schedule(PLANS[args.plan].epochs_of(name), rate=RATE)
        data = loop.Drawn(own.indices, lambda i, rng: {}, schedule.seed)
        loop.keep_start(net, data, schedule, args.out / f"checkpoints/{name}.pt")
    (args.out / "started").write_text(f"from {args.bundle}\n")


if __name__ == "__main__":
    main()
