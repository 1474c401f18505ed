"""Run the shipped pipeline on the paper grid P, in every preset and image method, and keep what it said.

    python -m shipshape_lab.experiments.evaluate_p --data runs/data --bundle models --out runs/results

Writes OUT/P.npz, or OUT/P_height_told.npz where the sensor's height above the water was told. Stopped runs go on
where they were; a finished file of the same bundle and set is left alone.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape.bundle import Bundle, load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.types import Contact
from shipshape_lab.commit import code_commit
from shipshape_lab.experiments import predictions
from shipshape_lab.experiments.predictions import Answers, Truth
from shipshape_lab.experiments.systems import PIPELINES, RAW, SYSTEMS, Run, run_systems
from shipshape_lab.training.examples import Examples

SAVE_EVERY = 1000  # clusters: half a minute of work to lose


def truth_of(examples: Examples, bundle: Bundle, index: np.ndarray, key: list[str]) -> Truth:
    """What is true of the clusters `index` of a set."""
    clusters = examples.clusters
    names = [vessel.name for vessel in bundle.catalogue]
    poses = [examples.example(int(i)).pose for i in tqdm(index, desc="truth", leave=False)]
    return Truth(
        key=np.array(key),
        index=index,
        label=np.array([names.index(clusters.name(int(i))) for i in index], np.int32),
        range_m=clusters.range_m[index],
        aspect_deg=clusters.aspect_deg[index],
        heading=clusters.heading[index],
        center=np.array([pose.origin_level[:2] for pose in poses], np.float32),
        size=np.array([(pose.size.length, pose.size.beam, pose.size.height) for pose in poses], np.float32),
        points=clusters.n[index],
    )


def answer(pipeline: Pipeline, contact: Contact, answers: Answers, column: int) -> None:
    """Let every system recognise a contact, and write what they said into column `column`."""
    answers.done[column] = True
    try:
        runs = run_systems(pipeline, contact)
    except InvalidInput:
        return  # the service refuses it: every system stays REFUSED, which counts as wrong
    for name in PIPELINES:
        _write(pipeline, runs[name], answers, (SYSTEMS.index(name), column))
    _write_raw(pipeline, runs[PIPELINES[0]].work.prior, answers, (SYSTEMS.index(RAW), column))


def _write(pipeline: Pipeline, run: Run, answers: Answers, place: tuple[int, int]) -> None:
    said = pipeline.finish(run.work, run.stage_ms)
    answers.vessel[place] = [vessel.name for vessel in pipeline.bundle.catalogue].index(said.vessel)
    answers.probability[place] = said.probability
    answers.unknown[place] = said.unknown
    answers.heading[place] = said.heading
    answers.bow_probability[place] = said.bow_probability
    answers.center[place] = said.box.center_level[:2]
    answers.size[place] = said.box.size.length, said.box.size.beam, said.box.size.height
    answers.stage_ms[place] = [run.stage_ms[stage.name] for stage in pipeline.stages]


def _write_raw(pipeline: Pipeline, prior: np.ndarray, answers: Answers, place: tuple[int, int]) -> None:
    vessel = int(np.argmax(prior[:-1]))
    answers.vessel[place] = vessel
    answers.probability[place] = prior[vessel]
    answers.unknown[place] = prior[-1] > pipeline.bundle.parameters["common"]["unknown_above"]


def evaluate(examples: Examples, pipeline: Pipeline, truth: Truth, path: Path) -> Answers:
    """Answers for every cluster of `truth`, kept in `path` on the way."""
    told = truth.key[-1] == "told"
    blank = Answers.empty(len(SYSTEMS), len(truth.index), len(pipeline.stages))
    answers = predictions.resume(path, truth, blank)
    left = np.flatnonzero(~answers.done)
    for turn, column in enumerate(tqdm(left, desc=path.stem, mininterval=2.0), start=1):
        i = int(truth.index[column])
        height = float(examples.clusters.sensor_height[i]) if told else None
        answer(pipeline, Contact(examples.clusters.cluster(i), sensor_height=height), answers, int(column))
        if turn % SAVE_EVERY == 0 or turn == len(left):
            predictions.save(path, truth, answers)
    return answers


def main(argv: list[str] | None = None) -> None:
    """Command line: one pass over the set."""
    args = _parser().parse_args(argv)
    examples, bundle = Examples.read(args.data, "P"), load_bundle(args.bundle)
    index = np.arange(0, len(examples.clusters), args.every)
    height = "told" if args.sensor_height else "not told"
    key = [bundle.digest, predictions.digest_of(args.data / "P.npz"), height]
    name = "P_height_told" if args.sensor_height else "P"
    truth = truth_of(examples, bundle, index, key)
    answers = evaluate(examples, Pipeline(bundle), truth, args.out / f"{name}.npz")
    write_about(args.out / f"{name}.json", bundle, every=args.every, sensor_height=height)
    right = (answers.vessel == truth.label).mean(axis=1)
    for system, share in zip(SYSTEMS, right, strict=True):
        print(f"{system:<10} {100 * share:6.2f} % right")


def write_about(path: Path, bundle: Bundle, **more: object) -> None:
    """What the results beside `path` were computed with."""
    about = {
        "bundle": bundle.name,
        "bundle_digest": bundle.digest,
        "catalogue": [vessel.name for vessel in bundle.catalogue],
        "training": dict(bundle.training),
        "code": code_commit(),
        **more,
    }
    path.write_text(json.dumps(about, indent=2, sort_keys=True, default=str) + "\n")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m shipshape_lab.experiments.evaluate_p",
        description="Runs every system on set P and keeps its answers in OUT.",
        epilog="example: python -m shipshape_lab.experiments.evaluate_p --data runs/data --out runs/results",
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument(
        "--every", type=int, default=1, help="only each Nth cluster; take an N that does not divide 360, such as 7"
    )
    parser.add_argument("--sensor-height", action="store_true", help="tell the sensor's height above the water")
    return parser


if __name__ == "__main__":
    main()
