"""Static int8 for the networks of preset `best`; those of the paper stay float32.

Ranges are fitted on training examples as quantisation-aware training saw them (`fake_quantise`): moving averages
over batches. The extremes of all examples, the tool's default, suit other weights than these: docs/adr/0012.
"""

import logging
import shutil
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from onnxruntime.quantization import CalibrationDataReader, QuantType, quant_pre_process, quantize_static

from shipshape.pipeline import Pipeline
from shipshape.types import Options
from shipshape_lab.training import train_aligned, train_inpainting, train_points, train_spd2
from shipshape_lab.training.examples import Example, Examples, is_accepted
from shipshape_lab.training.partial import partial_bundle

BATCH, BATCHES = 64, 16
# Rectifiers are folded into the convolutions before them; what joins features of other scales stays float32.
OPERATORS = ["Conv", "Relu", "MaxPool"]
RANGES = {"CalibMovingAverage": True, "CalibMovingAverageConstant": 0.05}

Make = Callable[[Example, np.random.Generator], dict[str, np.ndarray]]


def quantise_all(networks: Path, to: Path, training: Examples, *, seed: int) -> None:
    """Copy the networks of a folder to another, those of preset `best` as int8."""
    shutil.rmtree(to, ignore_errors=True)
    to.mkdir(parents=True)
    makers = _makers(Pipeline(partial_bundle(networks, training.catalogue)))
    for path in sorted(networks.glob("*.onnx")):
        if path.stem in makers:
            inputs = _Inputs(training, makers[path.stem], np.random.default_rng(seed))
            _quantise(path, to / path.name, inputs)
        else:
            shutil.copyfile(path, to / path.name)


def _makers(pipeline: Pipeline) -> dict[str, Make]:
    return {
        "aligned": lambda example, rng: _planes(train_aligned.to_item(example, train_aligned.guess(example, rng))),
        "inpainting": lambda example, rng: _planes(
            train_inpainting.to_item(example, train_inpainting.guess(example, rng))
        ),
        "points": lambda example, rng: _points(train_points.to_item(example)),
        "prior": partial(_densest, train_spd2.of_prior(pipeline)),
        "spd2": partial(_densest, train_spd2.of_restored(pipeline, Options())),
    }


def _planes(item: dict) -> dict[str, np.ndarray]:
    return {name: item[name] for name in ("planes", "features")}


def _points(item: dict) -> dict[str, np.ndarray]:
    return {name: item[name] for name in train_points.INPUTS}


def _densest(describe: Callable, example: Example, rng: np.random.Generator) -> dict[str, np.ndarray]:
    images, _ = describe(example, rng)
    return {"images": images[0]}


class _Inputs(CalibrationDataReader):
    """Inputs of a network for randomly drawn training examples, a batch at a time."""

    def __init__(self, training: Examples, make: Make, rng: np.random.Generator) -> None:
        self._batches = self._drawn(training, make, rng)

    @staticmethod
    def _drawn(training: Examples, make: Make, rng: np.random.Generator) -> Iterator[dict[str, np.ndarray]]:
        drawn = (training.drawn(int(i), rng) for i in rng.permutation(training.indices))
        items = (make(example, rng) for example in drawn if is_accepted(example.contact))
        for _ in range(BATCHES):
            batch = [item for item, _ in zip(items, range(BATCH), strict=False)]
            yield {name: np.stack([item[name] for item in batch]) for name in batch[0]}

    def get_next(self) -> dict | None:
        """The next inputs, None at the end (onnxruntime's convention)."""
        return next(self._batches, None)


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
            op_types_to_quantize=OPERATORS,
            extra_options=RANGES,
        )
