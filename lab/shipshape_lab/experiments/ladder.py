"""What the cheaper answers of preset `best` are worth: every rung of its ladder on validation, P and H.

    python -m shipshape_lab.experiments.ladder --data runs/data --bundle models --out runs/results

The service takes a lower rung when the time left is too short for the full answer. Here each contact is computed
on each rung. On P the most probable vessel counts, on the others the decision, which may be "unknown". Headings
are those of vessels of the catalogue. Milliseconds are of the processor, the median of all contacts.
"""

import argparse
import math
import time
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape import frames
from shipshape.bundle import UNKNOWN, load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline, RungStages
from shipshape.types import Options, Recognition, Rung
from shipshape_lab import metrics
from shipshape_lab.experiments import outcome
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.training.examples import Example, Examples

EVERY = {"validation": 3, "P": 13, "H": 3}  # 13 shares no factor with the 360 headings of the grid
COLUMNS = ("right", "confidence", "turn", "stds", "bow", "ms")


def on_rung(pipeline: Pipeline, example: Example, rung: RungStages) -> tuple[Recognition, float]:
    """The answer of one rung and its milliseconds of processor time.

    Raises:
        InvalidInput: the contact cannot be one vessel's cluster.
    """
    started = time.thread_time()
    work = pipeline.begin(example.contact, Options())
    for stage in rung.stages:
        stage.run(work)
    said = pipeline.finish(work, {}, rung.name)
    return said, 1e3 * (time.thread_time() - started)


def judge(name: str, said: Recognition, ms: float, example: Example, catalogue: list[str]) -> tuple[float, ...]:
    """COLUMNS of one answer; heading and bow are NaN for a vessel outside the catalogue."""
    known = example.label < len(catalogue)
    named = said.vessel if name == "P" or not said.unknown else UNKNOWN
    confidence = said.probabilities[named]
    off = said.heading - example.pose.heading
    turn = abs(math.degrees(frames.wrap_half_turn(off))) if known else math.nan
    return (
        float(named == [*catalogue, UNKNOWN][example.label]),
        confidence,
        turn,
        math.radians(turn) / said.heading_std,
        float(math.cos(off) > 0) if known else math.nan,
        ms,
    )


def of_answers(name: str, found: dict[Rung, np.ndarray]) -> Numbers:
    """The numbers of every rung from its answers, (n, COLUMNS)."""
    numbers: Numbers = {f"{name}.ladder.clusters": len(found[Rung.FULL])}
    for rung, answers in found.items():
        right, confidence, turn, stds, bow, ms = answers.T
        numbers |= {
            f"{name}.ladder.accuracy.{rung}": float(right.mean()),
            f"{name}.ladder.ece.{rung}": metrics.calibration_error(confidence, right),
            f"{name}.ladder.heading_median_deg.{rung}": float(np.nanmedian(turn)),
            f"{name}.ladder.heading_within_5deg.{rung}": float(np.nanmean(turn[np.isfinite(turn)] <= 5.0)),
            f"{name}.ladder.within_1std.{rung}": float(np.nanmean(stds[np.isfinite(stds)] <= 1.0)),
            f"{name}.ladder.bow_stern.{rung}": float(np.nanmean(bow)),
            f"{name}.ladder.ms.{rung}": float(np.median(ms)),
        }
    return numbers


def answers_of(name: str, examples: Examples, pipeline: Pipeline, every: int) -> dict[Rung, np.ndarray]:
    """Every rung's answers to every n-th contact of a set; one that the service refuses is left out."""
    catalogue = [vessel.name for vessel in pipeline.bundle.catalogue]
    ladder = pipeline.ladder(Options())
    found: dict[Rung, list[tuple[float, ...]]] = {rung.name: [] for rung in ladder}
    for i in tqdm(examples.indices[::every], desc=f"ladder {name}", mininterval=2.0):
        example = examples.example(int(i))
        for rung in ladder:
            try:
                said, ms = on_rung(pipeline, example, rung)
            except InvalidInput:
                break
            found[rung.name].append(judge(name, said, ms, example, catalogue))
    return {rung: np.array(answers) for rung, answers in found.items()}


def main(argv: list[str] | None = None) -> None:
    """Answer all sets on all rungs and write what came of it: about a minute on one core."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--out", type=Path, required=True, help="folder for ladder.json")
    parser.add_argument("--every", type=int, help="take every n-th contact (default 3, of P 13)")
    args = parser.parse_args(argv)
    pipeline = Pipeline(load_bundle(args.bundle))
    found: Numbers = {}
    for name, every in EVERY.items():
        answers = answers_of(name, Examples.read(args.data, name), pipeline, args.every or every)
        found |= of_answers(name, answers)
    print(outcome.write(args.out, "ladder", found, bundle_digest=pipeline.bundle.digest, sets=list(EVERY)))


if __name__ == "__main__":
    main()
