"""Milliseconds of the `best` pipeline on one core, stage by stage, for clusters of several sizes.

    python benchmarks/pipeline.py --bundle models --out runs/results

Ray-cast clusters of one hull from twelve headings, thinned to exactly the number of points, take turns. One
thread on one core. Elapsed times are what counts, so run it on an idle machine; the processor time beside the
total tells how much of it other programs took. Writes OUT/pipeline_ms.json.
"""

import argparse
import os
import platform
import sys
import time
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.types import Contact
from shipshape_lab.experiments import numbers, outcome
from shipshape_lab.simulator.datasets import hull
from shipshape_lab.simulator.recipes import TEST_HULLS
from shipshape_lab.simulator.scan import scan_vessel
from shipshape_lab.simulator.sea import Placement
from shipshape_lab.simulator.sensor import DEFAULT_LIDAR

SIZES = (100, 300, 1000, 3000)
HEADINGS_DEG = range(7, 360, 30)
VESSEL = "patrol_boat"
RANGES_M = range(200, 9, -5)
WARM_UP = 24
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
ONE_THREAD = dict.fromkeys(_THREADS, "1")


def cluster_of(count: int, heading_deg: int, rng: np.random.Generator) -> np.ndarray:
    """Exactly `count` points: the farthest scan of the hull that has as many, thinned at random.

    Raises:
        ValueError: no scan has as many points.
    """
    vessel = hull(VESSEL, TEST_HULLS[0])
    for range_m in RANGES_M:
        heading = np.radians(heading_deg if heading_deg <= 180 else heading_deg - 360)
        placement = Placement(float(range_m), float(heading), 0.3, 3.0)
        points = scan_vessel(vessel, DEFAULT_LIDAR, placement=placement, rng=rng).points_level
        if len(points) >= count:
            return points[np.sort(rng.choice(len(points), count, replace=False))]
    raise ValueError(
        f"expected a {VESSEL} to show {count} points somewhere from {RANGES_M[0]} m, but it never did"
    )


def measure(pipeline: Pipeline, contacts: list[Contact], runs: int) -> dict[str, np.ndarray]:
    """Milliseconds of the whole (`total`; `processor`: its processor time) and of each stage, one entry a run."""
    times: dict[str, list[float]] = {"total": [], "processor": []}
    for turn in range(WARM_UP + runs):
        started, busy = time.perf_counter(), time.process_time()
        recognition = pipeline.run(contacts[turn % len(contacts)])
        total, processor = (time.perf_counter() - started) * 1e3, (time.process_time() - busy) * 1e3
        if turn < WARM_UP:
            continue
        times["total"].append(total)
        times["processor"].append(processor)
        for stage, milliseconds in recognition.stage_ms.items():
            times.setdefault(stage, []).append(milliseconds)
    return {name: np.array(values) for name, values in times.items()}


def summary(times: dict[str, np.ndarray]) -> dict[str, dict]:
    """Median and 95th percentile of the whole and of each stage."""
    spread = {
        name: {"median": round(float(np.median(ms)), 4), "p95": round(float(np.percentile(ms, 95)), 4)}
        for name, ms in times.items()
    }
    return {"total": spread.pop("total"), "processor": spread.pop("processor"), "stages": spread}


def machine() -> dict[str, object]:
    """What it was measured on."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = [
            line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line
        ]
        model = models[0] if models else model
    return {"system": f"{platform.system()} {platform.machine()}", "processor": model, "cores": os.cpu_count()}


def use_one_core() -> None:
    """Stay on the last core that this process may use; the first one serves most interrupts."""
    cv2.setNumThreads(1)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def table(measured: dict[str, dict]) -> str:
    """Median and p95 milliseconds; a row a stage, a column a size."""
    lines = ["median / p95 ms".ljust(18) + "".join(f"{size} points".rjust(18) for size in measured)]
    stages = next(iter(measured.values()))["stages"]
    rows = [(stage, [timing["stages"][stage] for timing in measured.values()]) for stage in stages]
    sums = [(name, [timing[name] for timing in measured.values()]) for name in ("total", "processor")]
    for name, cells in [*rows, *sums]:
        lines.append(name.ljust(18) + "".join(f"{ms['median']:9.3f} /{ms['p95']:7.3f}" for ms in cells))
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> None:
    """Command line: measures, prints a table, writes the file."""
    args = _parser().parse_args(argv)
    use_one_core()
    bundle = load_bundle(args.bundle)
    pipeline, measured = Pipeline(bundle), {}
    for size in tqdm(SIZES, desc="sizes", leave=False):
        rng = np.random.default_rng([args.seed, size])
        contacts = [Contact(cluster_of(size, heading, rng)) for heading in HEADINGS_DEG]
        measured[str(size)] = summary(measure(pipeline, contacts, args.runs))
    about = {
        "machine": machine(),
        "bundle_digest": bundle.digest,
        "stages": [stage.name for stage in pipeline.stages],
        "runs": args.runs,
        "seed": args.seed,
    }
    outcome.write(args.out, "pipeline_ms", numbers.of_pipeline_ms(measured), **about)
    print(table(measured))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description="Measures the best pipeline in process on one core.",
        epilog="example: python benchmarks/pipeline.py --bundle models --out runs/results --runs 240",
    )
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument("--runs", type=int, default=240, help="runs of each size after warm-up (default 240)")
    parser.add_argument("--seed", type=int, default=5, help="seed of the clusters (default 5)")
    return parser


if __name__ == "__main__":
    if any(os.environ.get(name) != "1" for name in ONE_THREAD):
        # Libraries read these when they are imported, which has happened by now: start anew.
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **ONE_THREAD})
    main()
