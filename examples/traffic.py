"""Plays the simulated contacts of a harbour to a service as a LiDAR would: scan after scan, each with a deadline.

The LiDAR's own vessel turns slowly, so every scan shows the contacts at other bearings. A scan that comes too late
for the next one is worth nothing: its deadline is the time between two scans, and what is refused is left out.

Example:
    python examples/traffic.py 127.0.0.1:50051 --hz 10 --contacts 6
"""

import argparse
import itertools
import math
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import grpc
import numpy as np

from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1 import shipshape_pb2_grpc

CONTACTS = Path(__file__).parent / "contacts.npz"
TURN_DEG_PER_S = 2.0
LANES = (pb.LANE_COLLISION, *[pb.LANE_TRACKING] * 3, pb.LANE_BATCH)
SAY_EVERY_S = 10.0
NO_PROXY = [("grpc.enable_http_proxy", 0)]


def main() -> int:
    """Send until --seconds have passed, SIGTERM or Ctrl-C; returns 0 when any contact was answered."""
    arguments = parse()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    seen: Counter[str] = Counter()
    said = time.monotonic()
    with grpc.insecure_channel(arguments.address, options=NO_PROXY) as channel:
        stub = shipshape_pb2_grpc.ShipshapeStub(channel)
        try:
            for request in paced(scans(arguments.contacts, arguments.hz), arguments.hz, arguments.seconds):
                seen.update(outcomes(stub, request, 1 / arguments.hz))
                if time.monotonic() - said > SAY_EVERY_S:
                    said = time.monotonic()
                    print(dict(seen), flush=True)
        except KeyboardInterrupt:
            pass
    print(dict(seen), flush=True)
    return 0 if seen["ok"] else 1


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", help="HOST:PORT of a gRPC door")
    parser.add_argument("--hz", type=float, default=10.0, help="scans a second (default: %(default)s)")
    parser.add_argument("--contacts", type=int, default=6, help="of a scan (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=math.inf, help="then stop (default: never)")
    arguments = parser.parse_args()
    if arguments.hz <= 0 or arguments.contacts < 1:
        parser.error(f"expected --hz above 0 and --contacts of 1 or more, got {arguments.hz} {arguments.contacts}")
    return arguments


def scans(contacts: int, hz: float) -> Iterator[pb.RecogniseScanRequest]:
    """Scan after scan, without end; beyond those of the file, contacts are the same at other bearings."""
    sample = np.load(CONTACTS, allow_pickle=False)
    clusters = np.split(sample["points"], np.cumsum(sample["n"])[:-1])
    for number in itertools.count():
        turn = math.radians(TURN_DEG_PER_S) * number / hz
        yield pb.RecogniseScanRequest(
            contacts=[
                pb.Contact(
                    contact_id=str(index),
                    points=turned(clusters[index % len(clusters)], turn + index // len(clusters)).tobytes(),
                    sensor_height_m=float(sample["sensor_height"]),
                )
                for index in range(contacts)
            ],
            options=pb.Options(lane=LANES[number % len(LANES)]),
        )


def turned(points_level: np.ndarray, radians: float) -> np.ndarray:
    """Points (n, 3), level frame, seen from a vessel that has turned by so many radians to starboard."""
    cos, sin = math.cos(radians), math.sin(radians)
    rotation = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return (points_level @ rotation.T).astype("<f4")


def paced(
    requests: Iterator[pb.RecogniseScanRequest], hz: float, seconds: float
) -> Iterator[pb.RecogniseScanRequest]:
    """The requests, each at its time; a turn that has passed already is left out, as a LiDAR would."""
    start = time.monotonic()
    for number, request in enumerate(requests):
        due = start + number / hz
        if due - start >= seconds:
            return
        if (early := due - time.monotonic()) > 0:
            time.sleep(early)
        elif early < -1 / hz:
            continue
        yield request


def outcomes(
    stub: shipshape_pb2_grpc.ShipshapeStub, request: pb.RecogniseScanRequest, timeout_s: float
) -> list[str]:
    """What became of each contact: ok, or the kind of its error."""
    request.options.captured_at = time.time()
    try:
        response = stub.RecogniseScan(request, timeout=timeout_s, wait_for_ready=False)
    except grpc.RpcError as error:
        return [error.code().name.lower()] * len(request.contacts)
    return ["ok" if result.HasField("recognition") else "refused" for result in response.results]


if __name__ == "__main__":
    sys.exit(main())
