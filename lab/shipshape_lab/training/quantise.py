"""Static int8 for the networks that cost most and lose least by it; the others stay float32.

Ranges are fitted on training examples. Quantising `aligned` was tried and left: it costs bow/stern on validation.
"""

import logging
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from onnxruntime.quantization import CalibrationDataReader, QuantType, quant_pre_process, quantize_static

from shipshape_lab.training import train_inpainting, train_sight
from shipshape_lab.training.examples import Example, Examples

EXAMPLES = 400
# Convolutions alone where features of other scales join the image's later; None: everything.
OPERATORS: dict[str, list[str] | None] = {"inpainting": None, "sight": ["Conv"]}


def quantise_all(networks: Path, to: Path, training: Examples, *, seed: int) -> None:
    """Copy the networks of a folder to another, those named in OPERATORS as int8."""
    shutil.rmtree(to, ignore_errors=True)
    to.mkdir(parents=True)
    makers = {"inpainting": _inpainting_item, "sight": lambda example, rng: train_sight.to_item(example)}
    for path in sorted(networks.glob("*.onnx")):
        if path.stem in OPERATORS:
            inputs = _Inputs(training, makers[path.stem], np.random.default_rng(seed))
            _quantise(path, to / path.name, inputs)
        else:
            shutil.copyfile(path, to / path.name)


def _inpainting_item(example: Example, rng: np.random.Generator) -> dict:
    return train_inpainting.to_item(example, train_inpainting.guess(example, rng))


class _Inputs(CalibrationDataReader):
    """Inputs of a network for randomly drawn training examples, one at a time."""

    def __init__(
        self, training: Examples, make: Callable[[Example, np.random.Generator], dict], rng: np.random.Generator
    ) -> None:
        chosen = rng.choice(training.indices, EXAMPLES, replace=False)
        self._items: Iterator[dict] = (make(training.drawn(int(i), rng), rng) for i in chosen)

    def get_next(self) -> dict | None:
        """The next inputs, None at the end (onnxruntime's convention)."""
        item = next(self._items, None)
        return item and {name: item[name][None] for name in ("planes", "features")}


def _quantise(source: Path, to: Path, inputs: CalibrationDataReader) -> None:
    logging.getLogger().setLevel(logging.ERROR)  # the tool advises steps that are already taken
    with tempfile.TemporaryDirectory() as folder:
        prepared = Path(folder) / source.name
        quant_pre_process(str(source), str(prepared), skip_symbolic_shape=True)
        quantize_static(
            str(prepared),
            str(to),
            inputs,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=OPERATORS[source.stem],
        )
