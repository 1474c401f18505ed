"""How much a flood of batch work moves the latency of contacts in the collision lane: p99 without and with it.

    python -m benchmarks.lane_flood
    python -m benchmarks.lane_flood --seconds 2 --rounds 1     # does everything work?

Run it in the root of the checkout, on a quiet machine. Contacts of the collision lane come at Poisson times, alone
and beside a flood in turns. The flood is calls of 32 contacts that are sent again as soon as they are answered, so
many of them that they nearly fill the batch lane. Exit code 1: p99 moved by more than the target.
"""

import argparse
import json
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import numpy as np
from tqdm import tqdm

from benchmarks.serving import client, environments, processes, wires
from benchmarks.serving.bare import pinned
from benchmarks.serving.client import Load
from benchmarks.serving.contacts import contacts
from benchmarks.serving.measure import until_ready
from benchmarks.serving.servers import SERVERS
from benchmarks.serving.wires import Clusters, Wire
from shipshape.v1 import shipshape_pb2 as pb

TARGET = 1.2  # p99 with the flood over p99 without it, at most
SCAN, CALLS = 32, 7  # contacts a call, and calls at a time: nearly all places that its lane has by default
URGENT = wires.binary("/v1/recognise?lowest_rung=full&lane=collision")


@dataclass(frozen=True, slots=True)
class Turn:
    """What one round gave; milliseconds, and contacts a second of the flood."""

    alone_p99: float
    flooded_p99: float
    alone_p50: float
    flooded_p50: float
    flood: float


def main() -> int:
    """Measure, print, write; 1 if the target was missed."""
    args = _parser().parse_args()
    server = next(server for server in SERVERS if server.name == "rest_binary")
    environments.prepare(server)
    cores = tuple(sorted(os.sched_getaffinity(0)))
    with (
        processes.running(server, cores[-args.cores :], args.out.with_suffix(".log")) as (process, port),
        pinned(cores[: -args.cores] or cores) as urgent,
        pinned(cores[: -args.cores] or cores) as flood,
    ):
        clusters = contacts(args.seed)
        wire = URGENT(clusters)
        until_ready(urgent, wire, process, port)
        urgent.submit(client.closed, wire, port, 1.0).result()
        turns = []
        for turn in tqdm(range(args.rounds), desc="rounds", leave=False, disable=None):
            ask = (client.open_loop, wire, port, args.seconds, args.rate, args.seed + turn)
            alone = urgent.submit(*ask).result()
            flooding = flood.submit(client.closed, flood_of(clusters), port, 1.5 * args.seconds)
            flooded = urgent.submit(*ask).result()
            turns.append(_turn(alone, flooded, flooding.result()))
    return _report(turns, args.out)


def flood_of(clusters: Clusters) -> Wire:
    """Calls of many contacts in the batch lane."""
    points = [clusters[index % len(clusters)].astype("<f4").tobytes() for index in range(SCAN)]
    options = pb.Options(lowest_rung=pb.RUNG_FULL, lane=pb.LANE_BATCH)
    request = pb.RecogniseScanRequest(contacts=[pb.Contact(points=each) for each in points], options=options)
    return replace(
        wires.scan(SCAN)(clusters), requests=(request.SerializeToString(),), connections=CALLS, most=CALLS
    )


def _turn(alone: Load, flooded: Load, flood: Load) -> Turn:
    for load in (alone, flooded):
        if set(load.statuses) != {200}:
            raise RuntimeError(f"expected only status 200 in the collision lane, got {load.statuses}")
    if not flood.contacts:
        raise RuntimeError(f"expected a flood of batch work, got {flood.statuses}")
    quantiles = [float(np.percentile(load.latency_ms, share)) for share in (99, 50) for load in (alone, flooded)]
    return Turn(*quantiles, flood.contacts / flood.seconds)


def _report(turns: list[Turn], out: Path) -> int:
    middle = {name: median(getattr(turn, name) for turn in turns) for name in Turn.__slots__}
    ratios = [turn.flooded_p99 / turn.alone_p99 for turn in turns]
    ratio = median(ratios)
    found = {**middle, "p99_ratio": ratio, "p99_ratios": ratios, "target": TARGET}
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(found, indent=1) + "\n")
    print("collision lane     p50 ms   p99 ms")
    print(f"alone            {middle['alone_p50']:8.2f} {middle['alone_p99']:8.2f}")
    print(f"beside a flood   {middle['flooded_p50']:8.2f} {middle['flooded_p99']:8.2f}", end="")
    print(f"   of {middle['flood']:.0f} batch contacts a second")
    spread = f"{min(ratios):.2f} to {max(ratios):.2f}"
    print(f"p99 with the flood over p99 without: {ratio:.2f} ({spread} in {len(turns)} rounds), target {TARGET}")
    return int(ratio > TARGET)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.lane_flood",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--rate", type=float, default=50.0, help="collision contacts a second (default 50)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each measurement (default 20)")
    parser.add_argument("--rounds", type=int, default=5, help="alone and flooded in turns (default 5)")
    parser.add_argument("--cores", type=int, default=1, help="of the service; others generate load (default 1)")
    parser.add_argument("--out", type=Path, default=Path("runs/lane_flood.json"), help="file of the numbers")
    parser.add_argument("--seed", type=int, default=5, help="of contacts and arrivals (default 5)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
