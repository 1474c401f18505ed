"""How many cores, pods and megabits: arithmetic from what one core computes, as the table of docs/deploy.md.

What one core computes is measured, by `python -m benchmarks.serving` or `shipshape loadtest --sweep`, on the
processor that will do the work; 300 points a contact.

Example:
    python deploy/sizing.py                         # from benchmarks/results/serving.json
    python deploy/sizing.py --per-core 300          # from a number of your own
    python deploy/sizing.py --per-core 300 --vessels 40 --contacts 8 --hz 5
"""

import argparse
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

RESULTS = Path(__file__).parents[1] / "benchmarks/results/serving.json"
MEASURED = "throughput.grpc_scan8"  # contacts a second as a fleet sends them: scans over gRPC
FLEETS = (1, 10, 100, 1_000, 10_000)  # vessels

# Of a pod; deploy/kubernetes, deploy/kserve and docker-compose.yml have the same, which a test checks.
POD_CORES = 2
POD_MEMORY_MIB = 1024

BUSY = 0.7  # share of the cores in use at the expected load; beyond it the slowest answers get slow quickly
SPARE = 0.1  # pods beyond: a node that fails, a rollout
POINTS = 300  # of a contact
POINT_BYTES = 12  # three float32
OTHER_BYTES = 100  # of a contact: id, lane, framing, its share of the headers


@dataclass(frozen=True, slots=True)
class Size:
    """What a load takes.

    Attributes:
        rate: Contacts a second.
        cores: To compute them with BUSY of each.
        pods: Of POD_CORES, with what is spare.
        memory_gib: That these pods may use.
        inbound_mbit: Network towards them, Mbit/s.
    """

    rate: float
    cores: float
    pods: int
    memory_gib: float
    inbound_mbit: float


def size(rate: float, per_core: float) -> Size:
    """What `rate` contacts a second take when one core computes `per_core` of them."""
    cores = rate / (per_core * BUSY)
    needed = math.ceil(cores / POD_CORES)
    pods = needed + max(1, math.ceil(needed * SPARE))
    inbound = rate * (POINTS * POINT_BYTES + OTHER_BYTES) * 8 / 1e6
    return Size(rate, cores, pods, pods * POD_MEMORY_MIB / 1024, inbound)


def table(vessels: tuple[int, ...], contacts: int, hz: float, per_core: float) -> str:
    """Markdown, a row a fleet."""
    lines = [
        f"| vessels | contacts/s | cores | pods of {POD_CORES} cores | memory, GiB | network in, Mbit/s |",
        "|---|---|---|---|---|---|",
    ]
    for fleet in vessels:
        of = size(fleet * contacts * hz, per_core)
        lines.append(
            f"| {fleet:,} | {of.rate:,.0f} | {of.cores:,.1f} | {of.pods:,} | {of.memory_gib:,.0f} "
            f"| {of.inbound_mbit:,.0f} |"
        )
    return "\n".join(lines)


def measured(results: Path) -> float:
    """Contacts a second and core of a run of `python -m benchmarks.serving`.

    Raises:
        ValueError: There is none, or it lacks the number.
    """
    try:
        numbers = json.loads(results.read_text(encoding="utf-8"))
        return float(numbers[MEASURED]) / int(numbers["about.cores"].split()[0])
    except (OSError, KeyError, ValueError) as error:
        raise ValueError(
            f"expected {MEASURED} and about.cores in {results}, got: {error}; name a number with --per-core"
        ) from error


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--per-core", type=float, metavar="N", help="contacts a second that one core computes")
    parser.add_argument("--vessels", type=int, nargs="+", default=FLEETS, metavar="N", help="a row for each")
    parser.add_argument("--contacts", type=int, default=20, help="of a scan (default: %(default)s)")
    parser.add_argument("--hz", type=float, default=10.0, help="scans a second (default: %(default)s)")
    arguments = parser.parse_args()
    try:
        per_core = measured(RESULTS) if arguments.per_core is None else arguments.per_core
    except ValueError as error:
        print(f"sizing: {error}", file=sys.stderr)
        return 2
    if min(per_core, arguments.contacts, arguments.hz, *arguments.vessels) <= 0:
        parser.error("expected numbers above 0")
    print(table(tuple(arguments.vessels), arguments.contacts, arguments.hz, per_core))
    return 0


if __name__ == "__main__":
    sys.exit(main())
