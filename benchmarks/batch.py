"""What share of the bare pipeline's throughput `shipshape batch` reaches on files of ready-cut clusters.

    python -m benchmarks.batch --bundle models --out runs/results

The limit is the pipeline alone, in as many processes, each on clusters of the same sizes that were loaded before
the clock starts. The run reads files, spreads, recognises and writes parts: from the first chunk that is read to
the last part on disk. What starts and ends a run (loading the bundle, merging, plots) does not count. Both take
turns, and the median of the ratios of neighbours counts, since other programs slow both. The ratio of processor
seconds (of the bare pipeline; of all processes of the run) is told beside it: it holds on a busy machine too.
Writes OUT/batch.json.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
import orjson
from tqdm import tqdm

from benchmarks.pipeline import ONE_THREAD, cluster_of, machine
from shipshape.batch.engines import LocalEngine
from shipshape.batch.inputs import Inputs
from shipshape.batch.method import Method
from shipshape.batch.results import open_results
from shipshape.batch.units import Part
from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.types import Contact

POINTS = 300
HEADINGS_DEG = range(7, 360, 30)
WARM_UP = 24


def write_files(folder: Path, files: int, clusters: int, seed: int) -> list[Path]:
    """Files of so many clusters each, no two alike."""
    rng = np.random.default_rng(seed)
    hulls = [cluster_of(POINTS, heading, rng) for heading in HEADINGS_DEG]
    paths = []
    for number in range(files):
        chosen = [hulls[index] for index in rng.integers(0, len(hulls), clusters)]
        points = np.concatenate(chosen) + rng.normal(0, 0.002, (POINTS * clusters, 3))
        paths.append(folder / f"{number:04d}.npz")
        np.savez(paths[-1], points=points.astype(np.float32), n=np.full(clusters, POINTS))
    return paths


def bare_seconds(folder: Path, path: Path, workers: int) -> tuple[float, float]:
    """Seconds of the pipeline alone for a file, in each of so many processes; and seconds of processors."""
    with ProcessPoolExecutor(workers, mp_context=get_context("fork")) as executor:
        seconds, busy = zip(*executor.map(_bare, [folder] * workers, [path] * workers), strict=True)
    return max(seconds), sum(busy)


def _bare(folder: Path, path: Path) -> tuple[float, float]:
    cv2.setNumThreads(1)
    pipeline = Pipeline(load_bundle(folder))
    with np.load(path) as scan:
        clusters = np.split(scan["points"], np.cumsum(scan["n"])[:-1])
    contacts = [Contact(np.ascontiguousarray(points)) for points in clusters]
    for contact in contacts[:WARM_UP]:
        pipeline.run(contact)
    started, busy = time.perf_counter(), time.process_time()
    for contact in contacts:
        pipeline.run(contact)
    return time.perf_counter() - started, time.process_time() - busy


def batch_seconds(folder: Path, paths: list[Path], workers: int) -> tuple[float, float]:
    """Seconds of a run from the first chunk that is read to the last part on disk; and seconds of processors."""
    engine = LocalEngine.start(folder, Method(), workers)
    with tempfile.TemporaryDirectory() as out, open_results(Path(out), {}, clouds=False) as results:
        inputs = Inputs(paths)
        started, busy = time.perf_counter(), _processor_seconds()
        for item in engine.run(inputs.sources(), Method(), results.parts):
            if isinstance(item, Part):
                results.add(item)
        return time.perf_counter() - started, _processor_seconds() - busy


def _processor_seconds() -> float:
    """Of this process and of all that it has waited for."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def main(argv: list[str] | None = None) -> None:
    """Print the ratio, and write it down."""
    args = _parser().parse_args(argv)
    ratios, busy_ratios, rates = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        paths = write_files(Path(folder), args.workers, args.clusters, args.seed)
        for _ in tqdm(range(args.runs), desc="runs", leave=False):
            limit, bare_busy = bare_seconds(args.bundle, paths[0], args.workers)
            seconds, busy = batch_seconds(args.bundle, paths, args.workers)
            rates.append(len(paths) * args.clusters / seconds)
            ratios.append(limit / seconds)
            busy_ratios.append(bare_busy / busy)
    ratio, busy_ratio, rate = map(statistics.median, (ratios, busy_ratios, rates))
    print(f"batch: {rate:.0f} contacts/s on {args.workers} cores, {ratio:.3f} of the bare pipeline")
    print(f"bare pipeline over run, processor seconds: {busy_ratio:.3f}")
    args.out.mkdir(parents=True, exist_ok=True)
    found = {
        "throughput_over_bare": ratio,
        "processor_over_bare": busy_ratio,
        "contacts_per_s": rate,
        "workers": args.workers,
        "ratios": ratios,
    }
    found |= {"machine": machine(), "seed": args.seed, "clusters": args.clusters}
    (args.out / "batch.json").write_bytes(orjson.dumps(found, option=orjson.OPT_INDENT_2))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description="Measures a batch run against the bare pipeline.",
        epilog="example: python -m benchmarks.batch --bundle models --out runs/results",
    )
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--out", type=Path, default=Path("runs/results"), help="folder for results")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)), help="processes, each way")
    parser.add_argument("--clusters", type=int, default=4096, help="of each worker (default 4096)")
    parser.add_argument("--runs", type=int, default=5, help="each way, in turns (default 5)")
    parser.add_argument("--seed", type=int, default=5, help="of the clusters (default 5)")
    return parser


if __name__ == "__main__":
    if any(os.environ.get(name) != "1" for name in ONE_THREAD):
        # Libraries read these when they are imported, which has happened by now: start anew.
        words = [sys.executable, "-m", "benchmarks.batch", *sys.argv[1:]]
        os.execve(sys.executable, words, {**os.environ, **ONE_THREAD})
    main()
