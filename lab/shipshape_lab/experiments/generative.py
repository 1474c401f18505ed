"""The generative restorer beside the deterministic one: quality, accuracy, milliseconds, worth of its spread.

    python -m shipshape_lab.experiments.generative --data runs/data --flows runs/generative --out runs/results

For 1, 2, 4 and 8 Euler steps it takes the bundle FLOWS/bundle_N and, for samples that differ, FLOWS/flow_N.onnx.
Every bundle is run whole, by the service's own pipeline, on the subsample of P and of H that `restoration` takes;
clouds are scored as there. On every TENTH of these clusters SAMPLES vessels are drawn besides
(`generative_spread`). Leaves OUT/generative_p.npz, OUT/generative_h.npz, OUT/generative.json and the figure.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
import torch
from tqdm import tqdm

from shipshape.bundle import load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, Options, Recognition
from shipshape_lab import metrics
from shipshape_lab.experiments import generative_figure, generative_spread, outcome
from shipshape_lab.experiments.generative_spread import DETERMINISTIC, TENTH
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.predictions import digest_of
from shipshape_lab.experiments.restoration import EVERY, SCORES, score
from shipshape_lab.experiments.restore_ms import contacts_of, machine, measure
from shipshape_lab.experiments.systems import Run
from shipshape_lab.simulator.clusters import load
from shipshape_lab.training.examples import Example, Examples

STEPS = (1, 2, 4, 8)
SYSTEMS = (DETERMINISTIC, *(f"flow_{steps}" for steps in STEPS))
_BEFORE, _TIMED = ("prior", "heading", "bow_stern"), ("projection", "inpainting", "lifting")


def pipelines_of(base: Path, flows: Path) -> dict[str, Pipeline]:
    """The pipeline of every system: the deterministic bundle's and those of FLOWS/bundle_N.

    Raises:
        BundleError: a bundle is missing or damaged.
    """
    folders = [base, *(flows / f"bundle_{steps}" for steps in STEPS)]
    return {name: Pipeline(load_bundle(folder)) for name, folder in zip(SYSTEMS, folders, strict=True)}


def right(name: str, said: Recognition, label: int, catalogue: list[str]) -> bool:
    """Whether the answer is right: on P the most probable vessel, on H the decision, which may be unknown."""
    if name == "P" or not said.unknown:
        return catalogue.index(said.vessel) == label
    return label == len(catalogue)


def answer(name: str, pipelines: dict[str, Pipeline], example: Example, i: int) -> np.ndarray:
    """SCORES of every system's restored cloud, and whether its answer is right, (systems, scores + 1).

    Raises:
        InvalidInput: the service refuses the cluster.
    """
    said = {system: pipe.run(Contact(example.contact.points_level)) for system, pipe in pipelines.items()}
    clouds = {system: one.restored.points_level for system, one in said.items()}
    scored = score(clouds, example, np.random.default_rng([0, i]))
    names = [vessel.name for vessel in pipelines[DETERMINISTIC].bundle.catalogue]
    return np.array([(*scored[system], right(name, said[system], example.label, names)) for system in SYSTEMS])


def answers(name: str, pipelines: dict[str, Pipeline], examples: Examples, index: np.ndarray) -> np.ndarray:
    """`answer` to the clusters `index`, (M, systems, scores + 1); a refused one is NaN, and not right."""
    found = np.full((len(index), len(SYSTEMS), len(SCORES) + 1), np.nan)
    found[:, :, -1] = 0.0
    for row, i in enumerate(tqdm(index, desc=f"generative {name}", mininterval=2.0)):
        try:
            found[row] = answer(name, pipelines, examples.example(int(i)), int(i))
        except InvalidInput:
            continue
    return found


def of_answers(name: str, found: np.ndarray) -> Numbers:
    """Means of every system, and by how much each flow leads the deterministic restorer, paired."""
    scale = np.array([metrics.REPORTED_FACTOR] * 2 + [1.0, 1.0])
    numbers: Numbers = {f"{name}.generative.clusters": len(found)}
    for place, system in enumerate(SYSTEMS):
        means = np.nanmean(found[:, place, :-1], axis=0) * scale
        numbers |= {f"{name}.{what}.{system}": float(mean) for what, mean in zip(SCORES, means, strict=True)}
        numbers[f"{name}.accuracy.{system}"] = float(found[:, place, -1].mean())
        lead = (found[:, 0, 0] - found[:, place, 0]) * metrics.REPORTED_FACTOR
        lead = lead[np.isfinite(lead)]
        if system != DETERMINISTIC:
            numbers[f"{name}.cd_l1_lead.{system}"] = float(lead.mean())
            numbers[f"{name}.cd_l1_lead_error.{system}"] = float(lead.std() / np.sqrt(len(lead)))
    return numbers


def milliseconds(data: Path, pipelines: dict[str, Pipeline], turns: int) -> Numbers:
    """Median processor milliseconds from the pose to the restored cloud on P, as `restore_ms` has it."""
    base = pipelines[DETERMINISTIC]
    runs = [Run(base.begin(one, Options())).through(base, _BEFORE) for one in contacts_of(load(data / "P.npz"))]
    systems = {
        name: lambda run, pipe=pipe: run.branch(Options()).through(pipe, _TIMED)
        for name, pipe in pipelines.items()
    }
    return {
        f"P.restore_ms.{name}": float(np.median(found[:, 1]))
        for name, found in measure(systems, runs, turns).items()
    }


def on_set(name: str, args: argparse.Namespace, pipelines: dict[str, Pipeline]) -> Numbers:
    """The numbers of one set; a set that was finished with the same bundles is not run again."""
    examples = Examples.read(args.data, name)
    every = args.every or EVERY[name]
    index = np.arange(0, len(examples.clusters), every)
    path = args.out / f"generative_{name.lower()}.npz"
    digests = [pipe.bundle.digest for pipe in pipelines.values()]
    files = [args.data / f"{name}.npz", *(args.flows / f"{system}.onnx" for system in SYSTEMS[1:])]
    key = [*digests, digest_of(*files), str(every)]
    kept = _kept(path, key)
    if kept is None:
        samplers = generative_spread.samplers_of(pipelines, args.flows)
        kept = {
            "answers": answers(name, pipelines, examples, index),
            "spread": generative_spread.draw(samplers, examples, index[::TENTH]),
        }
        args.out.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(path, key=key, **kept)
    return of_answers(name, kept["answers"]) | generative_spread.of_spread(name, kept["spread"], SYSTEMS)


def _kept(path: Path, key: list[str]) -> dict[str, np.ndarray] | None:
    if not path.exists():
        return None
    with np.load(path, allow_pickle=False) as arrays:
        return dict(arrays) if arrays["key"].tolist() == key else None


def main(argv: list[str] | None = None) -> None:
    """Measure, write OUT/generative.json and the figure."""
    args = _parser().parse_args(argv)
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    pipelines = pipelines_of(args.bundle, args.flows)
    found = milliseconds(args.data, pipelines, args.turns)
    for name in EVERY:
        found |= on_set(name, args, pipelines)
    base = pipelines[DETERMINISTIC].bundle
    about = {"bundle_digest": base.digest, "every": args.every or EVERY, "machine": machine(), "turns": args.turns}
    flow = dict(pipelines["flow_4"].bundle.training)
    path = outcome.write(args.out, "generative", found, **about, flow=flow)
    samplers = generative_spread.samplers_of(pipelines, args.flows)
    drawn = generative_figure.draw(samplers, Examples.read(args.data, "H"), args.figures)
    print("\n".join(f"{key:<32} {value:.4f}" for key, value in found.items()))
    print(f"wrote {path} and {drawn}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--flows", type=Path, required=True, help="folder of flow_N.onnx and bundle_N")
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument("--every", type=int, help="only each Nth cluster (default 13 of P, 5 of H)")
    parser.add_argument(
        "--figures", type=Path, default=Path("docs/figures"), help="folder for figures (default docs/figures)"
    )
    parser.add_argument("--turns", type=int, default=48, help="clusters that each system restores (default 48)")
    return parser


if __name__ == "__main__":
    main()
