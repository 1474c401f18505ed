"""Half an hour at 70 % of what the service can do: does its memory grow, does it leave files open, does it fail?

    python -m benchmarks.soak
    python -m benchmarks.soak --minutes 2 --every 1     # does everything work?

Run it in the root of the checkout, on a quiet machine. Writes OUT.json with every sample and OUT.png, and
prints the slope of the resident memory with its 95 % interval. Exit code 1: memory grows by more than the noise
explains, files stay open, or a request failed.
"""

import argparse
import json
import math
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import psutil
from matplotlib.figure import Figure
from scipy import stats
from tqdm import tqdm

from benchmarks.serving import client, environments, processes
from benchmarks.serving.bare import pinned
from benchmarks.serving.client import Load
from benchmarks.serving.contacts import contacts
from benchmarks.serving.measure import BUSY_SHARE, until_ready
from benchmarks.serving.servers import SERVERS
from benchmarks.serving.wires import Wire

SETTLING = 0.2  # share of the run after which allocators and pools have what they need: not counted
CONFIDENCE = 0.95
TRIFLE_MB = 1.0  # an hour: where nothing else moves, a few new pages would be growth beyond doubt
SPAN_MB = 10.0  # that the picture shows at least
IDLE_S, FEW_FILES = 2.0, 2  # until connections are closed, and more open files than before that are no leak
CAPACITY_S, SPELL_S = 10.0, 60.0  # of the measurement of the capacity, and of one order to the load generator


@dataclass(frozen=True, slots=True)
class Sample:
    """The service and all its children at one moment."""

    seconds: float
    rss_mb: float
    descriptors: int


@dataclass(frozen=True, slots=True)
class Slope:
    """Growth an hour, MB, and the interval in which it lies with 95 %."""

    an_hour: float
    low: float
    high: float

    @property
    def grows(self) -> bool:
        """Whether there is more than a trifle, and chance alone would hardly show so much."""
        return self.low > TRIFLE_MB

    def __str__(self) -> str:
        return f"{self.an_hour:+.2f} MB an hour (95 %: {self.low:+.2f} to {self.high:+.2f})"


def main() -> int:
    """Run, report; 1 if something grew or failed."""
    args = _parser().parse_args()
    server = next(server for server in SERVERS if server.name == args.door)
    environments.prepare(server)
    cores = tuple(sorted(os.sched_getaffinity(0)))
    args.out.parent.mkdir(parents=True, exist_ok=True)
    with (
        processes.running(server, cores[-args.cores :], args.out.with_suffix(".log")) as (process, port),
        pinned(cores[: -args.cores] or cores) as generator,
    ):
        wire = server.write(contacts(args.seed))
        until_ready(generator, wire, process, port)
        warm = generator.submit(client.closed, wire, port, CAPACITY_S).result()
        rate = args.rate or BUSY_SHARE * warm.contacts / warm.seconds / wire.contacts
        open_before = _idle(process)
        samples, loads = _watched(process, _spells(generator, wire, port, rate, args), args)
        left_open = _idle(process) - open_before
    return _report(samples, loads, left_open, args)


def slope_of(seconds: Sequence[float], values: Sequence[float]) -> Slope:
    """The line through the values: its slope an hour, and how sure that is.

    Neighbouring samples resemble each other, so that they tell less than as many independent ones: the interval is
    widened by what their correlation takes away.
    """
    fit = stats.linregress(seconds, values)
    left = np.asarray(values) - (fit.intercept + fit.slope * np.asarray(seconds))
    spread = float(left @ left)
    alike = max(0.0, float(left[1:] @ left[:-1]) / spread) if spread > 0 else 0.0
    wider = math.sqrt((1 + alike) / max(1 - alike, 1 / len(left)))
    reach = stats.t.ppf(0.5 + CONFIDENCE / 2, len(left) - 2) * fit.stderr * wider
    return Slope(*(3600 * each for each in (fit.slope, fit.slope - reach, fit.slope + reach)))


def _spells(
    generator: ProcessPoolExecutor, wire: Wire, port: int, rate: float, args: argparse.Namespace
) -> Iterator[Future[Load]]:
    left, seed = args.minutes * 60, args.seed
    while left > 0:
        yield generator.submit(client.open_loop, wire, port, min(SPELL_S, left), rate, seed)
        left, seed = left - SPELL_S, seed + 1


def _watched(
    process: psutil.Popen, spells: Iterator[Future[Load]], args: argparse.Namespace
) -> tuple[list[Sample], list[Load]]:
    """Samples at even times while the load is sent, whatever comes of it."""
    samples, loads, started = [], [], time.perf_counter()
    with tqdm(total=round(args.minutes * 60), unit="s", desc="soak", disable=None) as progress:
        for spell in spells:
            while not spell.done():
                now = time.perf_counter() - started
                if process.poll() is not None:
                    raise RuntimeError(f"expected the service to live, got exit code {process.returncode}")
                samples.append(_sample(process, now))
                progress.set_postfix_str(f"{samples[-1].rss_mb:.1f} MB")
                progress.update(min(round(now), progress.total) - progress.n)
                wait([spell], timeout=len(samples) * args.every - (time.perf_counter() - started))
            loads.append(spell.result())
    return samples, loads


def _sample(process: psutil.Popen, seconds: float) -> Sample:
    family = [process, *process.children(recursive=True)]
    return Sample(seconds, processes.rss_mb(process), sum(member.num_fds() for member in family))


def _idle(process: psutil.Popen) -> int:
    """Open files once the connections of the last load are closed."""
    time.sleep(IDLE_S)
    return _sample(process, 0.0).descriptors


def _report(samples: list[Sample], loads: list[Load], left_open: int, args: argparse.Namespace) -> int:
    counted = [sample for sample in samples if sample.seconds >= SETTLING * samples[-1].seconds]
    memory = slope_of([sample.seconds for sample in counted], [sample.rss_mb for sample in counted])
    statuses = sum((Counter(load.statuses) for load in loads), Counter())
    errors = sum(count for status, count in statuses.items() if status != 200)
    found = {
        "minutes": args.minutes,
        "rate": statuses.total() / (args.minutes * 60),
        "requests": statuses.total(),
        "errors": errors,
        "statuses": dict(statuses),
        "rss_mb_an_hour": asdict(memory),
        "files_left_open": left_open,
        "lag_p99_ms": max(load.lag_ms for load in loads),
        "samples": [asdict(sample) for sample in samples],
    }
    args.out.with_suffix(".json").write_text(json.dumps(found, indent=1) + "\n")
    _draw(samples, memory, args.out.with_suffix(".png"))
    print(f"{statuses.total()} requests at {found['rate']:.0f} a second, {errors} failed: {dict(statuses)}")
    print(f"resident memory: {counted[-1].rss_mb:.1f} MB, {memory}")
    print(f"files left open: {left_open}")
    return int(memory.grows or left_open > FEW_FILES or errors > 0)


def _draw(samples: list[Sample], memory: Slope, path: Path) -> None:
    minutes = [sample.seconds / 60 for sample in samples]
    figure = Figure(figsize=(8, 5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    above.plot(minutes, [sample.rss_mb for sample in samples], color="#0b6e99")
    low, high = above.get_ylim()
    spare = max(0.0, SPAN_MB - (high - low)) / 2
    above.set_ylim(low - spare, high + spare)
    above.axvspan(0, SETTLING * minutes[-1], color="#eeeeee", zorder=0)
    above.set(ylabel="resident, MB", title=f"{memory}; the grey part is not counted")
    below.plot(minutes, [sample.descriptors for sample in samples], color="#444444", drawstyle="steps-post")
    below.set(xlabel="minutes", ylabel="open files")
    for axes in (above, below):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130)


def _parser() -> argparse.ArgumentParser:
    doors = [server.name for server in SERVERS if server.ours]
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.soak", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=30.0, help="of load (default 30)")
    parser.add_argument("--every", type=float, default=10.0, help="seconds between two samples (default 10)")
    parser.add_argument("--rate", type=float, help="requests a second (default: 70 %% of a measured capacity)")
    parser.add_argument("--door", choices=doors, default=doors[0], help=f"of {', '.join(doors)}")
    parser.add_argument("--cores", type=int, default=1, help="of the service; others generate load (default 1)")
    parser.add_argument("--out", type=Path, default=Path("runs/soak"), help="files OUT.json, OUT.png and OUT.log")
    parser.add_argument("--seed", type=int, default=5, help="of contacts and arrivals (default 5)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
