"""What the client costs beside a bare stub: milliseconds of one contact over gRPC, callers taking turns.

    make serve                                                  # in another terminal
    python benchmarks/client.py 127.0.0.1:50051 --out runs/results

One call at a time; capacity calls, which compute nothing, show the client's own time. Writes OUT/client.json.
"""

import argparse
import asyncio
import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import grpc
from tqdm import tqdm

from shipshape.client import AsyncClient, Client
from shipshape.client.messages import from_contact
from shipshape.sample import sample_contact
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

TIMEOUT_S = 10.0
WARM_UP = 20


def measure(calls: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Median milliseconds of each, one call of each a round."""
    took: dict[str, list[float]] = {name: [] for name in calls}
    for number in tqdm(range(WARM_UP + rounds), unit="round", disable=not sys.stderr.isatty()):
        for name, call in calls.items():
            started = time.perf_counter()
            call()
            if number >= WARM_UP:
                took[name].append((time.perf_counter() - started) * 1e3)
    return {name: statistics.median(times) for name, times in took.items()}


def main() -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", nargs="?", default="127.0.0.1:50051")
    parser.add_argument("--rounds", type=int, default=500)
    parser.add_argument("--out", type=Path, default=Path("runs/results"))
    arguments = parser.parse_args()
    url, contact = f"grpc://{arguments.address}", sample_contact()
    request, capacity = pb.RecogniseRequest(contact=from_contact(contact)), pb.GetCapacityRequest()
    client = AsyncClient(url, timeout_s=TIMEOUT_S)
    with grpc.insecure_channel(arguments.address) as channel, Client(url, timeout_s=TIMEOUT_S) as blocking:
        stub, runner = ShipshapeStub(channel), asyncio.Runner()
        with runner:
            runner.run(client.__aenter__())
            found = measure(
                {
                    "stub, capacity": lambda: stub.GetCapacity(capacity, timeout=TIMEOUT_S),
                    "Client, capacity": blocking.capacity,
                    "AsyncClient, capacity": lambda: runner.run(client.capacity()),
                    "stub, contact": lambda: stub.Recognise(request, timeout=TIMEOUT_S),
                    "Client, contact": lambda: blocking.recognise(contact),
                    "AsyncClient, contact": lambda: runner.run(client.recognise(contact)),
                },
                arguments.rounds,
            )
            runner.run(client.__aexit__(None, None, None))
    for name, milliseconds in found.items():
        print(f"{name:24}{milliseconds:8.3f} ms")
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "client.json").write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
