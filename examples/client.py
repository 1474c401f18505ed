"""Shipshape from Python, with the client of the package: one contact, a scan, and a stream of scans.

Example:
    make serve                              # in another terminal
    python examples/client.py               # or: python examples/client.py grpcs://ship:50051 grpcs://shore:50051
"""

import sys
from pathlib import Path

import numpy as np

from shipshape.client import Client, Contact, Refusal, Wishes
from shipshape.errors import ShipshapeError

HERE = Path(__file__).parent
PATIENCE_S = 5.0  # a program that steers by the answers sets milliseconds


def main() -> int:
    """Ask the endpoints that are given, the preferred first; returns the exit code."""
    try:
        with Client(*(sys.argv[1:] or ["grpc://127.0.0.1:50051"]), timeout_s=PATIENCE_S) as client:
            contacts = read_scan()
            show_one(client, contacts[1])
            show_scan(client, contacts)
            show_stream(client, contacts)
    except ShipshapeError as error:
        print(f"client: {error}", file=sys.stderr)
        return 1
    return 0


def read_scan() -> list[Contact]:
    """The contacts of the example scan: points in metres, level frame."""
    saved = np.load(HERE / "contacts.npz", allow_pickle=False)
    clusters = np.split(saved["points"], np.cumsum(saved["n"])[:-1])
    height = float(saved["sensor_height"])
    return [Contact(cluster, str(number), height) for number, cluster in enumerate(clusters, 1)]


def show_one(client: Client, contact: Contact) -> None:
    """One contact, with its whole shape."""
    answer = client.recognise(contact, Wishes(restored=True))
    print(f"{answer.vessel} {answer.probability:.4f} {np.degrees(answer.heading):.2f}")
    print(f"  {answer.measured_points} points measured, {answer.inferred_points} inferred, by {answer.endpoint}")


def show_scan(client: Client, contacts: list[Contact]) -> None:
    """All contacts of a scan in one call; each has an answer or a reason of its own."""
    for result in client.scan(contacts):
        if isinstance(result, Refusal):
            print(f"  contact {result.contact_id}: {result.error}")
        else:
            print(f"  contact {result.contact_id}: {'unknown' if result.unknown else result.vessel}")


def show_stream(client: Client, contacts: list[Contact]) -> None:
    """A scan a message over one call, as a sensor would send them."""
    for answer in client.stream([contacts[:2], contacts[2:4], contacts[4:]]):
        print(f"  scan {answer.sequence}: {len(answer.results)} contacts, {answer.error or 'in time'}")


if __name__ == "__main__":
    sys.exit(main())
