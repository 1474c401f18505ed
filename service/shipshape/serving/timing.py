"""What callers are told about time: the budget, the default deadline, and each stage's milliseconds."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

LONGEST_MS = 3_600_000.0  # that any request may take, whatever its caller says


@dataclass(frozen=True, slots=True)
class Timeouts:
    """Milliseconds."""

    default_ms: float = 5000.0  # a request may take, when its caller sets no deadline
    budget_ms: float = 50.0  # an answer is meant to take


def server_timing(stage_ms: Mapping[str, float]) -> str:
    """Milliseconds of each stage in the form of the Server-Timing header: "prior;dur=0.31, heading;dur=1.2"."""
    return ", ".join(f"{stage};dur={milliseconds:.3f}" for stage, milliseconds in stage_ms.items())


def summed(contacts: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Milliseconds of each stage over all contacts of a scan."""
    total: dict[str, float] = {}
    for stage_ms in contacts:
        for stage, milliseconds in stage_ms.items():
            total[stage] = total.get(stage, 0.0) + milliseconds
    return total
