"""How a request ended, as its caller sees it."""

from dataclasses import dataclass
from enum import IntEnum

MAX_DETAIL = 200  # characters of what a target said


class Outcome(IntEnum):
    """From good to bad: a scan ends as its worst contact."""

    OK = 0  # answered in full
    DEGRADED = 1  # answered on a lower rung of the ladder
    REFUSED = 2  # RESOURCE_EXHAUSTED, 429: come back later
    EXPIRED = 3  # DEADLINE_EXCEEDED, 504, or no answer by the deadline
    UNAVAILABLE = 4  # UNAVAILABLE, 503, or no connection
    ERROR = 5  # anything else
    UNSENT = 6  # too many requests were under way: the tool kept this one back

    @property
    def label(self) -> str:
        """As it stands in reports."""
        return self.name.lower()

    @property
    def answered(self) -> bool:
        """Whether the caller got something to use."""
        return self <= Outcome.DEGRADED


FULL = "full"  # the top rung


@dataclass(frozen=True, slots=True)
class Reply:
    """What came back, and in words if it was not an answer."""

    outcome: Outcome
    detail: str = ""


def answered_on(rungs: list[str]) -> Reply:
    """The reply of a target that answered, on these rungs of its ladder; a target without one answers in full."""
    return Reply(Outcome.OK if all(rung == FULL for rung in rungs) else Outcome.DEGRADED)


def worst(replies: list[Reply]) -> Reply:
    """The reply that a scan of these contacts counts as."""
    return max(replies, key=lambda reply: reply.outcome, default=Reply(Outcome.OK))
