"""What the reason codes and the stated spread of the heading of preset `best` are worth, on validation and on H.

    python -m shipshape_lab.experiments.reasons --data runs/data --bundle models --out runs/results

Each code is held to what it warns of: few_points to a wrong name, bow_uncertain to a wrong bow, end_on to a length
off by more than 10 % (these three on vessels of the catalogue alone), occluded to a fifth of the returns or more
hidden, out_of_catalogue to a vessel outside of it. *Precision* is the share of contacts with the code to which
that happened, *recall* the share of those to which it happened that had the code. The thresholds were fitted on
the validation set; H is only reported. A contact that the service refuses is left out.
"""

import argparse
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape import frames
from shipshape.bundle import UNKNOWN, load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.types import Reason, Recognition
from shipshape_lab.experiments import outcome
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.training.calibrate import LENGTH_RIGHT
from shipshape_lab.training.examples import Example, Examples
from shipshape_lab.training.reason_thresholds import MUCH_HIDDEN

SETS = ("validation", "H")
RANGES_M = ((25, 60), (60, 100), (100, 150), (150, 200))
OFF_ENDS_DEG = ((0, 15), (15, 45), (45, 90))


@dataclass(frozen=True)
class Answer:
    """One answer beside the truth."""

    reasons: tuple[Reason, ...]
    catalogue: bool
    named_right: bool
    bow_right: bool
    length_right: bool
    hidden_share: float  # of the returns; NaN where the set does not say
    turn: float  # error of the heading modulo pi in units of the stated standard deviation
    range_m: float
    off_ends_deg: float  # as it truly is


def judge(said: Recognition, example: Example, catalogue: list[str], hidden_share: float) -> Answer:
    """The answer beside the truth of an example."""
    truth, off = example.pose, said.heading - example.pose.heading
    aspect = frames.aspect_deg(truth.heading, truth.origin_level)
    return Answer(
        reasons=said.reasons,
        catalogue=example.label < len(catalogue),
        named_right=(UNKNOWN if said.unknown else said.vessel) == [*catalogue, UNKNOWN][example.label],
        bow_right=math.cos(off) > 0,
        length_right=abs(said.box.size.length / truth.size.length - 1.0) <= LENGTH_RIGHT,
        hidden_share=hidden_share,
        turn=abs(frames.wrap_half_turn(off)) / said.heading_std,
        range_m=math.hypot(*truth.origin_level[:2]),
        off_ends_deg=min(aspect, 180.0 - aspect),
    )


def of_answers(name: str, answers: list[Answer]) -> Numbers:
    """The numbers of the set `name`."""
    known = [answer for answer in answers if answer.catalogue]
    told = [answer for answer in answers if math.isfinite(answer.hidden_share)]
    held = {
        Reason.FEW_POINTS: (known, [not a.named_right for a in known]),
        Reason.END_ON: (known, [not a.length_right for a in known]),
        Reason.OCCLUDED: (told, [a.hidden_share >= MUCH_HIDDEN for a in told]),
        Reason.BOW_UNCERTAIN: (known, [not a.bow_right for a in known]),
        Reason.OUT_OF_CATALOGUE: (answers, [not a.catalogue for a in answers]),
    }
    found: Numbers = {f"{name}.reason.clusters": len(answers)}
    for reason, (among, happened) in held.items():
        given = np.array([reason in answer.reasons for answer in among], np.bool_)
        for key, value in _worth(given, np.array(happened, np.bool_)):
            found[f"{name}.reason_{key}.best.{reason}"] = value
    for part, turns in _turns(known):
        found[f"{name}.heading_std.best.within_1std{part}"] = float((turns <= 1.0).mean())
        found[f"{name}.heading_std.best.within_2std{part}"] = float((turns <= 2.0).mean())
    return found


def _worth(given: np.ndarray, happened: np.ndarray) -> Iterator[tuple[str, float]]:
    if not len(given):
        return
    yield "given", float(given.mean())
    if given.any():
        yield "precision", float(happened[given].mean())
    if happened.any():
        yield "recall", float(given[happened].mean())


def _turns(known: list[Answer]) -> Iterator[tuple[str, np.ndarray]]:
    turns = np.array([answer.turn for answer in known])
    range_m = np.array([answer.range_m for answer in known])
    off_ends = np.array([answer.off_ends_deg for answer in known])
    parts = {"": np.ones(len(known), np.bool_)}
    parts |= {f".{low}_{high}m": (range_m >= low) & (range_m < high) for low, high in RANGES_M}
    parts |= {f".off_ends_{low}_{high}deg": (off_ends >= low) & (off_ends <= high) for low, high in OFF_ENDS_DEG}
    yield from ((part, turns[mask]) for part, mask in parts.items() if mask.any())


def answers_of(name: str, examples: Examples, pipeline: Pipeline, stride: int) -> list[Answer]:
    """Every `stride`-th contact of a set, answered as the service would; the sensor's height is told."""
    catalogue = [vessel.name for vessel in pipeline.bundle.catalogue]
    found = []
    for i in tqdm(examples.indices[::stride], desc=f"reasons {name}", mininterval=2.0):
        example = examples.example(int(i))
        try:
            said = pipeline.run(example.contact)
        except InvalidInput:
            continue
        found.append(judge(said, example, catalogue, float(examples.clusters.hidden_share[i])))
    return found


def main(argv: list[str] | None = None) -> None:
    """Answer both sets and write what came of it: a minute or two on one core, so nothing is kept between runs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, required=True, help="model bundle")
    parser.add_argument("--out", type=Path, required=True, help="folder for reasons.json")
    parser.add_argument("--stride", type=int, default=1, help="take every n-th contact (default 1)")
    args = parser.parse_args(argv)
    pipeline = Pipeline(load_bundle(args.bundle))
    found: Numbers = {}
    for name in SETS:
        found |= of_answers(name, answers_of(name, Examples.read(args.data, name), pipeline, args.stride))
    print(outcome.write(args.out, "reasons", found, bundle_digest=pipeline.bundle.digest, sets=SETS))


if __name__ == "__main__":
    main()
