"""A trained network to an ONNX file, with the proof that both compute the same."""

import warnings
from pathlib import Path

import numpy as np
import onnxruntime
import torch
from torch import Tensor, nn

TOLERANCE = 1e-3  # largest difference of any output, absolute and relative to its spread


def export(
    net: nn.Module,
    inputs: dict[str, Tensor],
    outputs: list[str],
    path: Path,
    free: dict[str, dict[int, str]] | None = None,
) -> None:
    """Write `net` to `path` with a free batch dimension, and compare ONNX Runtime with torch on random inputs.

    Args:
        net: the trained network.
        inputs: an example of each input, in the order of `forward`.
        outputs: names of the outputs.
        path: file to write.
        free: further free dimensions of inputs: name to dimension to its name.

    Raises:
        ValueError: an output differs by more than TOLERANCE.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    net = net.cpu().eval()
    with warnings.catch_warnings():
        # The newer exporter needs one more package and gains nothing for plain convolutions.
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            net,
            tuple(inputs.values()),
            str(path),
            input_names=list(inputs),
            output_names=outputs,
            dynamic_axes={name: {0: "batch"} | (free or {}).get(name, {}) for name in [*inputs, *outputs]},
            opset_version=17,
            dynamo=False,
        )
    prove_equal(net, inputs, path)


def prove_equal(net: nn.Module, inputs: dict[str, Tensor], path: Path) -> float:
    """Largest difference between torch and ONNX Runtime over batches of random inputs.

    Raises:
        ValueError: it exceeds TOLERANCE.
    """
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    worst = 0.0
    generator = torch.Generator().manual_seed(0)
    for batch in (1, 3):
        random = {name: _alike(x, batch, generator) for name, x in inputs.items()}
        with torch.no_grad():
            wanted = net(*random.values())
        wanted = wanted if isinstance(wanted, tuple) else (wanted,)
        found = session.run(None, {name: x.numpy() for name, x in random.items()})
        for want, got in zip(wanted, found, strict=True):
            scale = 1.0 + float(want.abs().max())
            worst = max(worst, float(np.abs(want.numpy() - got).max()) / scale)
    if worst > TOLERANCE:
        raise ValueError(f"expected ONNX to equal torch within {TOLERANCE}, got a difference of {worst:.2g}")
    return worst


def _alike(example: Tensor, batch: int, generator: torch.Generator) -> Tensor:
    """Random values, or random choices among those of an example that counts something."""
    shape = (batch, *example.shape[1:])
    if example.is_floating_point():
        return torch.rand(shape, generator=generator)
    return torch.randint(int(example.max()) + 1, shape, generator=generator)
