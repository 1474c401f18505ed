"""What the spread of a generative restorer's samples is worth: drawn vessels against the true one.

Of every cluster SAMPLES vessels are drawn, each lifted as the service does. Two questions are put to them and,
since its occupancy is a probability too, to the deterministic restorer. By cell: is the mean occupancy of the
samples a better probability than the deterministic one (Brier score, over the cells that were not measured)? By
cluster: does the *doubt*, sum p (1 - p) / sum p over these cells, rank the clusters as their CD-L1 does
(Spearman)?
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr
from tqdm import tqdm

from shipshape.errors import InvalidInput
from shipshape.onnx_model import OnnxModel, Signature
from shipshape.pipeline import Pipeline
from shipshape.stages import projection
from shipshape.types import Contact, Options
from shipshape_lab import metrics
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.restoration import score
from shipshape_lab.experiments.systems import Run
from shipshape_lab.training.examples import Example, Examples

DETERMINISTIC = "deterministic"
SAMPLES = 8
TENTH = 10
VALUES = ("cd_l1", "cd_l1_best", "doubt", "brier")  # of one system on one cluster
_BEFORE, _RESTORED = ("prior", "heading", "bow_stern", "projection"), ("inpainting", "lifting")


class Drawing:
    """A restorer that draws noise for each run, if it takes any, and keeps the occupancy that the stage rounds."""

    def __init__(self, model: OnnxModel, seed: int) -> None:
        self._model, self._rng = model, np.random.default_rng(seed)
        shapes = {spec.name: spec.shape for spec in model.signature.inputs}
        self._noise = (1, *shapes["noise"][1:]) if "noise" in shapes else None
        self.occupancy = np.empty(0, np.float32)

    @property
    def signature(self) -> Signature:
        """Of the model; the pipeline compares its classes with the catalogue."""
        return self._model.signature

    @property
    def samples(self) -> int:
        """How many runs tell all: one, if no noise is drawn."""
        return 1 if self._noise is None else SAMPLES

    def run(self, **inputs: np.ndarray) -> list[np.ndarray]:
        """The outputs, as OnnxModel gives them."""
        if self._noise is not None:
            inputs["noise"] = self._rng.standard_normal(self._noise, np.float32)
        outputs = self._model.run(**inputs)
        self.occupancy = outputs[0][0].copy()
        return outputs


def samplers_of(pipelines: dict[str, Pipeline], flows: Path, seed: int = 7) -> dict[str, Pipeline]:
    """The same pipelines, each with a restorer that draws: FLOWS/NAME.onnx, the deterministic one as it is."""
    found = {}
    for name, pipeline in pipelines.items():
        models = dict(pipeline.bundle.models)
        model = models["inpainting"] if name == DETERMINISTIC else OnnxModel(flows / f"{name}.onnx")
        models["inpainting"] = Drawing(model, seed)
        found[name] = Pipeline(replace(pipeline.bundle, models=models))
    return found


def restorations(pipeline: Pipeline, start: Run) -> tuple[list[np.ndarray], np.ndarray]:
    """Clouds that a pipeline of `samplers_of` draws, level frame, and their mean occupancy (3, 32, 64).

    Args:
        pipeline: with a `Drawing` for restorer.
        start: a contact that went through the stages before inpainting.
    """
    drawing = pipeline.bundle.models["inpainting"]
    clouds, occupancies = [], []
    for _ in range(drawing.samples):
        restored = start.branch(Options()).through(pipeline, _RESTORED).work.restored
        clouds.append(restored.points_level)
        occupancies.append(drawing.occupancy)
    return clouds, np.mean(occupancies, axis=0)


def started(pipeline: Pipeline, points_level: np.ndarray) -> Run:
    """A contact after the stages before inpainting, which all restorers share.

    Raises:
        InvalidInput: the service refuses the cluster.
    """
    return Run(pipeline.begin(Contact(points_level), Options())).through(pipeline, _BEFORE)


def spread(samplers: dict[str, Pipeline], example: Example, i: int) -> np.ndarray:
    """VALUES of every system on one cluster, (systems, values).

    Raises:
        InvalidInput: the service refuses the cluster.
    """
    start = started(samplers[DETERMINISTIC], example.contact.points_level)
    work = start.work
    there = projection.project(example.surface_level, work.pose, work.frame).count > 0
    inferred = work.layers.count == 0
    drawn = {name: restorations(pipeline, start) for name, pipeline in samplers.items()}
    clouds = {(name, k): cloud for name, (own, _) in drawn.items() for k, cloud in enumerate(own)}
    scored = score(clouds, example, np.random.default_rng([0, i]))
    rows = []
    for name, (own, occupancy) in drawn.items():
        errors = [scored[name, k][0] for k in range(len(own))]
        chance = occupancy[inferred]
        doubt = (chance * (1 - chance)).sum() / max(chance.sum(), 1.0)
        rows.append((np.mean(errors), np.min(errors), doubt, np.mean((chance - there[inferred]) ** 2)))
    return np.array(rows)


def draw(samplers: dict[str, Pipeline], examples: Examples, index: np.ndarray) -> np.ndarray:
    """`spread` of the clusters `index`, (M, systems, values); a refused one is NaN."""
    found = np.full((len(index), len(samplers), len(VALUES)), np.nan)
    for row, i in enumerate(tqdm(index, desc="samples", mininterval=2.0)):
        try:
            found[row] = spread(samplers, examples.example(int(i)), int(i))
        except InvalidInput:
            continue
    return found


def of_spread(name: str, found: np.ndarray, systems: tuple[str, ...]) -> Numbers:
    """Mean CD-L1 (x 1000) of a sample and of the best, Brier score, and rank correlation of doubt with CD-L1."""
    found = found[np.isfinite(found[:, 0, 0])]
    numbers: Numbers = {f"{name}.generative.clusters_drawn": len(found)}
    for place, system in enumerate(systems):
        error, best, doubt, brier = found[:, place].T
        numbers[f"{name}.cd_l1_sample.{system}"] = float(error.mean() * metrics.REPORTED_FACTOR)
        numbers[f"{name}.cd_l1_best_sample.{system}"] = float(best.mean() * metrics.REPORTED_FACTOR)
        numbers[f"{name}.brier.{system}"] = float(brier.mean())
        numbers[f"{name}.doubt_rank.{system}"] = float(spearmanr(doubt, error).statistic)
    return numbers
