"""What became of all tasks, so that nothing is lost without a trace."""

from dataclasses import dataclass, replace
from typing import Any

from shipshape.errors import Cancelled, DeadlineExceeded
from shipshape.executor.ticket import Ticket


@dataclass(frozen=True, slots=True)
class Counts:
    """What became of all tasks; offered = refused + the five outcomes + those still pending."""

    offered: int = 0
    refused: int = 0
    completed: int = 0
    degraded: int = 0  # answered on another rung than the first
    expired: int = 0
    cancelled: int = 0
    failed: int = 0

    @property
    def pending(self) -> int:
        """Tasks admitted and not yet settled."""
        settled = self.completed + self.degraded + self.expired + self.cancelled + self.failed
        return self.offered - self.refused - settled

    def plus(self, outcome: str, count: int) -> "Counts":
        """The same with `count` more of one field."""
        return replace(self, **{outcome: getattr(self, outcome) + count})


def outcome_of(ticket: Ticket[Any]) -> str:
    """The field of `Counts` in which a settled ticket is counted."""
    if ticket.future.cancelled():
        return "cancelled"
    error = ticket.future.exception()
    if error is None:
        return "degraded" if ticket.degraded else "completed"
    if isinstance(error, DeadlineExceeded):
        return "expired"
    return "cancelled" if isinstance(error, Cancelled) else "failed"
