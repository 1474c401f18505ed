"""Clusters a second with runs of 1 to 32 rows: each network by itself, and the whole pipeline in threads.

    python benchmarks/micro_batches.py --provider cuda --out micro_batches.json
    python benchmarks/micro_batches.py --provider cpu --force

The first table calls each network from one thread with so many rows at once; its last column is the bucket up to
which the service would let calls share runs, by its own measurement. The second recognises the contacts of
examples/contacts.npz in as many threads as fill two runs: not shared, as the service would choose, and shared up
to each bucket (on a processor only with --force: there it gains nothing). Use an idle machine.
"""

import argparse
import itertools
import json
import statistics
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from shipshape.bundle import Bundle, load_bundle
from shipshape.errors import SettingsError
from shipshape.executor import usable_cores
from shipshape.micro_batches import BUCKETS
from shipshape.onnx_model import OnnxModel
from shipshape.pipeline import Pipeline
from shipshape.pointfiles import read_clusters
from shipshape.providers import Provider, Runtime, find_provider
from shipshape.types import Contact, ImageMethod, Options, Preset

ROOT = Path(__file__).parents[1]
WISHES = [Options(), *(Options(Preset.PAPER, method) for method in ImageMethod)]


class Recorder(OnnxModel):
    """A network that keeps what it was shown last."""

    def __init__(self, model: OnnxModel) -> None:
        self._model = model
        self.signature = model.signature
        self.inputs: dict[str, np.ndarray] = {}

    def run(self, **inputs: np.ndarray) -> list[np.ndarray]:
        """The network's own outputs."""
        self.inputs = inputs
        return self._model.run(**inputs)


def rows_per_s(model: OnnxModel, inputs: dict[str, np.ndarray], rows: int, seconds: float) -> float:
    """Rows a second of runs of so many rows, one after the other, median run."""
    repeated = {name: np.resize(array, (rows, *array.shape[1:])) for name, array in inputs.items()}
    model.run(**repeated)
    took, end = [], time.perf_counter() + seconds
    while len(took) < 5 or time.perf_counter() < end:
        started = time.perf_counter()
        model.run(**repeated)
        took.append(time.perf_counter() - started)
    return rows / statistics.median(took)


def networks(folder: Path, provider: Provider, contact: Contact, seconds: float) -> Iterator[tuple[str, dict]]:
    """Name of each network, its rows a second in runs of each size, and the bucket that would be chosen."""
    plain, chosen = (load_bundle(folder, Runtime(provider, mode)) for mode in ("off", "auto"))
    recorders = {name: Recorder(model) for name, model in plain.models.items()}
    pipeline = Pipeline(replace(plain, models=recorders))
    for options in WISHES:
        pipeline.run(contact, options)
    for name, recorder in recorders.items():
        chosen.models[name].run(**recorder.inputs)
        speeds = {str(rows): rows_per_s(plain.models[name], recorder.inputs, rows, seconds) for rows in BUCKETS}
        yield name, {"rows_per_s": speeds, "chosen": chosen.models[name].most_rows}


def recognise(bundle: Bundle, contacts: list[Contact], threads: int, seconds: float) -> dict[str, float]:
    """Clusters a second, and milliseconds a cluster, of so many threads that recognise one after the other."""
    pipeline = Pipeline(bundle)
    for contact in contacts:
        pipeline.run(contact)
    turns, took, end = itertools.count(), [], time.perf_counter() + seconds

    def work() -> None:
        while True:  # at least once, however slow the machine
            started = time.perf_counter()
            pipeline.run(contacts[next(turns) % len(contacts)])
            took.append(time.perf_counter() - started)
            if time.perf_counter() >= end:
                return

    workers = [threading.Thread(target=work) for _ in range(threads)]
    began = time.perf_counter()
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    p50, p99 = np.percentile(took, [50, 99]) * 1e3
    return {
        "threads": threads,
        "clusters_per_s": len(took) / (time.perf_counter() - began),
        "p50_ms": p50,
        "p99_ms": p99,
    }


def pipelines(
    folder: Path, provider: Provider, contacts: list[Contact], seconds: float, *, every: bool
) -> Iterator[tuple[str, dict[str, float]]]:
    """How runs are shared, and what `recognise` says of it."""
    cores, many = usable_cores(), 2 * BUCKETS[-1]
    ways = {
        "off": (Runtime(provider), cores),
        "off, more threads": (Runtime(provider), many),
        "auto": (Runtime(provider, "auto"), many),
    }
    for count, most in enumerate(BUCKETS[1:] if every else (), start=2):
        ways[f"up to {most}"] = (Runtime(provider, "on", BUCKETS[:count]), max(cores, 2 * most))
    for way, (runtime, threads) in ways.items():
        yield way, recognise(load_bundle(folder, runtime), contacts, threads, seconds)


def main(argv: list[str] | None = None) -> None:
    """Command line: measures, prints two tables as they grow, writes the file if one is named."""
    args = _parser().parse_args(argv)
    cv2.setNumThreads(1)
    try:
        provider = find_provider(args.provider)
    except SettingsError as error:
        sys.exit(f"micro_batches: {error}")
    clusters = read_clusters(ROOT / "examples/contacts.npz")
    contacts = [Contact(points, sensor_height=3.0) for points in clusters]
    print(
        f"{provider}, {usable_cores()} cores\n\nrows/s".ljust(24)
        + "".join(f"{rows:9d}" for rows in BUCKETS)
        + "   chosen"
    )
    found: dict[str, dict] = {"provider": provider, "cores": usable_cores(), "networks": {}, "pipeline": {}}
    for name, speeds in networks(args.bundle, provider, contacts[0], args.seconds / 10):
        found["networks"][name] = speeds
        cells = "".join(f"{speed:9.0f}" for speed in speeds["rows_per_s"].values())
        print(f"{name:24}{cells}{speeds['chosen']:9d}", flush=True)
    print(f"\n{'runs shared':20}{'threads':>9}{'clusters/s':>12}{'p50 ms':>9}{'p99 ms':>9}")
    every = args.force or provider is not Provider.CPU
    for way, told in pipelines(args.bundle, provider, contacts, args.seconds, every=every):
        found["pipeline"][way] = told
        print("{:20}{threads:9d}{clusters_per_s:12.0f}{p50_ms:9.2f}{p99_ms:9.2f}".format(way, **told), flush=True)
    if args.out:
        args.out.write_text(json.dumps(found, indent=1) + "\n")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description="Measures what shared runs of networks gain.",
        epilog="example: python benchmarks/micro_batches.py --provider cuda --out micro_batches.json",
    )
    parser.add_argument("--provider", choices=["auto", "cpu", "cuda"], default="auto", help="default: auto")
    parser.add_argument(
        "--force", action="store_true", help="measure every bucket in the pipeline on a processor too"
    )
    parser.add_argument("--bundle", type=Path, default=ROOT / "models", help="model bundle (default models)")
    parser.add_argument("--seconds", type=float, default=5.0, help="of each line of the second table (default 5)")
    parser.add_argument("--out", type=Path, help="file for the numbers, JSON")
    return parser


if __name__ == "__main__":
    main()
