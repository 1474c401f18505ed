"""What happened to each request."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64, Int64, UInt8

from shipshape.loadtest.outcomes import MAX_DETAIL, Outcome, Reply
from shipshape.loadtest.plan import Plan

MOST_COMPLAINTS = 5  # of which the words are kept


@dataclass(slots=True, eq=False)
class Records:
    """One entry a request, in the order of the plan; seconds after the start of what is counted.

    What was never sent has no `sent` and no `done`: NaN.
    """

    due: Float64[np.ndarray, " n"]
    sent: Float64[np.ndarray, " n"]
    done: Float64[np.ndarray, " n"]
    outcome: UInt8[np.ndarray, " n"]
    request: Int64[np.ndarray, " n"]
    complaints: list[str] = field(default_factory=list)

    def close(self, index: int, sent: float, done: float, reply: Reply) -> None:
        """Note how a request ended."""
        self.sent[index], self.done[index], self.outcome[index] = sent, done, reply.outcome
        if not reply.outcome.answered and len(self.complaints) < MOST_COMPLAINTS:
            complaint = f"{reply.outcome.label}: {reply.detail[:MAX_DETAIL]}"
            if complaint not in self.complaints:
                self.complaints.append(complaint)


def unsent(plan: Plan) -> Records:
    """The records of a plan before anything is sent."""
    count = len(plan.due)
    return Records(
        plan.due,
        np.full(count, np.nan),
        np.full(count, np.nan),
        np.full(count, Outcome.UNSENT, np.uint8),
        plan.request,
    )


def merged(parts: Sequence[Records]) -> Records:
    """The records of several processes as one, in the order in which requests were due."""
    order = np.argsort(np.concatenate([part.due for part in parts]), kind="stable")
    complaints = list(dict.fromkeys(complaint for part in parts for complaint in part.complaints))
    return Records(
        np.concatenate([part.due for part in parts])[order],
        np.concatenate([part.sent for part in parts])[order],
        np.concatenate([part.done for part in parts])[order],
        np.concatenate([part.outcome for part in parts])[order],
        np.concatenate([part.request for part in parts])[order],
        complaints[:MOST_COMPLAINTS],
    )
