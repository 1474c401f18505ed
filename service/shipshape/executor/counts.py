"""What became of all tasks, so that nothing is lost without a trace."""

from dataclasses import dataclass
from typing import Any

from shipshape.errors import Cancelled, DeadlineExceeded
from shipshape.executor.ticket import Ticket


@dataclass(slots=True)
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

    def settle(self, ticket: Ticket[Any]) -> None:
        """Count a ticket that is settled."""
        if ticket.future.cancelled():
            self.cancelled += 1
            return
        error = ticket.future.exception()
        if error is None:
            self.degraded += ticket.degraded
            self.completed += not ticket.degraded
        elif isinstance(error, DeadlineExceeded):
            self.expired += 1
        elif isinstance(error, Cancelled):
            self.cancelled += 1
        else:
            self.failed += 1
