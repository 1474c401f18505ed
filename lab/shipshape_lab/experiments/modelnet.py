"""Experiment 1 of the paper: how well four image methods, and that of `best`, restore masked ModelNet40 shapes.

    python -m shipshape_lab.experiments.modelnet --shapes ../shared/data/modelnet --networks runs/modelnet

Networks come from shipshape_lab.modelnet.train. Every test shape of the official list goes under four masks at
four losses (set M). Each cloud is compared as it is with the 10,000 points of the complete shape, of which the
points that a mask leaves are a part, as in the common benchmarks; so the raw cloud has no wrong point, only
missing ones. METHOD_floor is the complete shape to an image and back with nothing inpainted: what a perfect
network would leave. Writes OUT/modelnet.json and the figures; a run that was stopped goes on.
"""

import argparse
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape_lab import metrics
from shipshape_lab.experiments import modelnet_figures, outcome
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.predictions import digest_of
from shipshape_lab.modelnet import masks, methods
from shipshape_lab.modelnet.methods import METHODS, Method
from shipshape_lab.modelnet.record import Record
from shipshape_lab.modelnet.shapes import KINDS, Shape, Split, read_shapes

RAW = "raw"
RESTORED = (RAW, *METHODS)
FLOORS = tuple(f"{name}_floor" for name in METHODS)
CLOUDS = (*RESTORED, *FLOORS)
CELLS = tuple(product(masks.MASKS, masks.RATES))
SCORES = ("cd_l1", "cd_l2", "fscore", "points")
_KEEP_EVERY = 5  # shapes


def score_shape(shape: Shape, restorers: dict[str, Method], seed: int) -> np.ndarray:
    """Scores of one shape under every mask and loss, (cells, clouds, scores)."""
    truth = metrics.CompleteSurface(shape.points, shape.extent)
    scores = np.empty((len(CELLS), len(CLOUDS), len(SCORES)), np.float32)
    for column, name in enumerate(METHODS):
        scores[:, len(RESTORED) + column] = _scores(truth, restorers[name].round_trip(shape.points, shape.pose))
    for row, (mask, rate) in enumerate(CELLS):
        left = shape.points[masks.kept(shape.points, mask, rate, masks.chance(shape.name, mask, rate, seed))]
        scores[row, 0] = _scores(truth, left)
        for column, name in enumerate(METHODS, 1):
            scores[row, column] = _scores(truth, restorers[name].restore(left, shape.pose).points)
    return scores


def _scores(truth: metrics.CompleteSurface, cloud: np.ndarray) -> tuple[float, ...]:
    nearest = truth.nearest(cloud)
    return metrics.chamfer_l1(nearest), metrics.chamfer_l2(nearest), metrics.f_score(nearest), len(cloud)


def score_all(shapes: list[Shape], restorers: dict[str, Method], seed: int, kept: Path, key: str) -> np.ndarray:
    """Scores of all shapes, (shapes, cells, clouds, scores), kept in a file as they come.

    Args:
        shapes: the test shapes.
        restorers: the five methods.
        seed: of the masks.
        kept: file to keep them in; what is in there under the same key is not computed again.
        key: what the scores depend on.
    """
    scores = np.full((len(shapes), len(CELLS), len(CLOUDS), len(SCORES)), np.nan, np.float32)
    if kept.exists():
        with np.load(kept, allow_pickle=False) as arrays:
            scores = arrays["scores"] if str(arrays["key"]) == key else scores
    for i in tqdm(np.flatnonzero(np.isnan(scores[:, 0, 0, 0])), desc="shapes of M", mininterval=5.0):
        scores[i] = score_shape(shapes[i], restorers, seed)
        if i % _KEEP_EVERY == 0 or i == len(shapes) - 1:
            draft = kept.with_name(f".{kept.name}")  # ends in .npz, as savez wants
            np.savez_compressed(draft, scores=scores, key=key)
            draft.replace(kept)
    return scores


def of_scores(shapes: list[Shape], scores: np.ndarray) -> Numbers:
    """Means of every score: CD-L1 and CD-L2 (both x 1000), F-score@1 % in [0, 1], number of points."""
    scores = scores.astype(np.float64) * np.array([metrics.REPORTED_FACTOR] * 2 + [1.0, 1.0])
    found: Numbers = {"M.shapes": len(shapes)}
    for kind in KINDS:
        found[f"M.shapes.{kind}"] = sum(shape.kind == kind for shape in shapes)
    for part, picked in _slices(shapes):
        for column, cloud in enumerate(CLOUDS):
            if cloud in FLOORS and part not in ("overall", *KINDS):
                continue  # no mask has a part in it
            means = scores[np.ix_(*picked)][:, :, column].mean(axis=(0, 1))
            found |= {f"M.{name}.{cloud}.{part}": float(mean) for name, mean in zip(SCORES, means, strict=True)}
    return found


def _slices(shapes: list[Shape]) -> Iterator[tuple[str, tuple[np.ndarray, np.ndarray]]]:
    """Name, and which shapes and cells: all, each kind, mask, loss, and mask with loss."""
    every_shape, every_cell = np.arange(len(shapes)), np.arange(len(CELLS))
    yield "overall", (every_shape, every_cell)
    for kind in KINDS:
        chosen = np.flatnonzero([shape.kind == kind for shape in shapes])
        if len(chosen):
            yield kind, (chosen, every_cell)
    for mask in masks.MASKS:
        yield mask, (every_shape, np.flatnonzero([cell[0] == mask for cell in CELLS]))
    for rate in masks.RATES:
        yield f"loss_{rate}", (every_shape, np.flatnonzero([cell[1] == rate for cell in CELLS]))
    for i, (mask, rate) in enumerate(CELLS):
        yield f"{mask}_{rate}", (every_shape, np.array([i]))


def main(argv: list[str] | None = None) -> None:
    """Command line: scores, OUT/modelnet.json and the figures."""
    args = _parser().parse_args(argv)
    shapes, restorers = read_shapes(args.shapes, Split.TEST), methods.load(args.networks)
    records = {name: Record.read(args.networks, name) for name in METHODS}
    networks = digest_of(*(args.networks / f"{name}{end}" for name in METHODS for end in (".onnx", ".json")))
    key = f"{networks} {' '.join(shape.name for shape in shapes)} {args.seed}"
    args.out.mkdir(parents=True, exist_ok=True)
    found = of_scores(shapes, score_all(shapes, restorers, args.seed, args.out / "modelnet.npz", key))
    about = {"training": records[METHODS[0]].shapes, "empty_below": {k: r.empty_below for k, r in records.items()}}
    path = outcome.write(args.out, "modelnet", found, seed=args.seed, networks=networks, **about)
    drawn = modelnet_figures.draw(found, shapes, restorers, args.seed, args.figures)
    print(f"wrote {path} and {', '.join(map(str, drawn))}")
    for name in CLOUDS:
        l1, f = found[f"M.cd_l1.{name}.overall"], found[f"M.fscore.{name}.overall"]
        print(f"{name:<16} CD-L1 {l1:7.2f}  F@1% {f:.3f}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--shapes", type=Path, required=True, help="folder of the ModelNet40 point files and lists"
    )
    parser.add_argument("--networks", type=Path, required=True, help="what shipshape_lab.modelnet.train wrote")
    parser.add_argument(
        "--out", type=Path, default=Path("runs/results"), help="folder for results (default runs/results)"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of the masks (default 1)")
    parser.add_argument(
        "--figures", type=Path, default=Path("docs/figures"), help="folder for figures (default docs/figures)"
    )
    return parser


if __name__ == "__main__":
    main()
