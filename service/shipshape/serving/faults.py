"""Any exception -> what a caller is told: one kind and one sentence, the same through every door.

Each door has one table from kind to its own status code; this module knows of none.
"""

import logging
import math
import uuid
from dataclasses import dataclass
from enum import StrEnum

from shipshape.errors import (
    Cancelled,
    DeadlineExceeded,
    InvalidInput,
    NotReady,
    Overloaded,
    TooLarge,
    Unauthenticated,
    Unprocessable,
)

_logger = logging.getLogger(__name__)


class FaultKind(StrEnum):
    """Why there is no answer."""

    INVALID_INPUT = "invalid_input"
    TOO_LARGE = "too_large"
    UNPROCESSABLE = "unprocessable"
    OVERLOADED = "overloaded"
    DEADLINE_EXCEEDED = "deadline_exceeded"
    CANCELLED = "cancelled"
    NOT_READY = "not_ready"
    UNAUTHENTICATED = "unauthenticated"
    INTERNAL = "internal"


@dataclass(frozen=True, slots=True)
class Fault:
    """What the caller is told."""

    kind: FaultKind
    message: str
    retry_after_s: float | None = None  # when the caller may come back; only of what is overloaded

    @property
    def retry_after_ms(self) -> int | None:
        """The same in whole milliseconds, never too early."""
        return None if self.retry_after_s is None else math.ceil(self.retry_after_s * 1e3)


# The first class that fits; an error that is not listed tells the caller nothing but an id.
_KINDS: tuple[tuple[type[Exception], FaultKind], ...] = (
    (TooLarge, FaultKind.TOO_LARGE),
    (Unprocessable, FaultKind.UNPROCESSABLE),
    (InvalidInput, FaultKind.INVALID_INPUT),
    (Overloaded, FaultKind.OVERLOADED),
    (DeadlineExceeded, FaultKind.DEADLINE_EXCEEDED),
    (Cancelled, FaultKind.CANCELLED),
    (NotReady, FaultKind.NOT_READY),
    (Unauthenticated, FaultKind.UNAUTHENTICATED),
)


def fault_of(error: BaseException) -> Fault:
    """What the caller is told of `error`; one that was not meant is logged with its traceback and an id.

    Memory that runs out is meant: less at a time, or later, may well be answered.
    """
    for known, kind in _KINDS:
        if isinstance(error, known):
            return Fault(kind, str(error), getattr(error, "retry_after_s", None))
    if isinstance(error, MemoryError):
        _logger.error("out of memory", exc_info=error)
        return Fault(FaultKind.OVERLOADED, "expected memory for the answer, got too little: send less at a time")
    incident = uuid.uuid4().hex[:12]
    _logger.error("internal error %s", incident, exc_info=error)
    return Fault(FaultKind.INTERNAL, f"expected an answer, got an internal error; its id in the log is {incident}")
