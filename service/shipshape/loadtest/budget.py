"""The budget, and whether it was held."""

import math
import re
from dataclasses import dataclass
from enum import StrEnum

from shipshape.errors import SettingsError
from shipshape.loadtest.quantities import seconds_of

LAG_SHARE = 10  # the tool's own p99 lag may be one part in so many of the budget


class Verdict(StrEnum):
    """What a run says of its target."""

    HELD = "held"
    NOT_HELD = "not held"
    TOOL_TOO_SLOW = "tool too slow"

    @property
    def exit_code(self) -> int:
        """Of the command; 2 is a wrong command, or a target that cannot be tested."""
        return {Verdict.HELD: 0, Verdict.NOT_HELD: 1, Verdict.TOOL_TOO_SLOW: 3}[self]


@dataclass(frozen=True, slots=True)
class Budget:
    """Of all requests that were due, at least `share` are answered within `limit_s` of the moment they were due.

    What was refused, expired, failed or was never sent was not answered: it counts as later than any limit.
    """

    share: float  # 0.99 for p99
    limit_s: float

    @property
    def fewest(self) -> int:
        """Requests below which the share says nothing: fewer cannot tell one late answer from too many."""
        return math.ceil(round(1 / (1 - self.share), 6))

    def wanted(self, requests: int) -> int:
        """Of so many requests, how many must be in time."""
        return math.ceil(round(self.share * requests, 6))

    def __str__(self) -> str:
        return f"p{self.share * 100:g} <= {self.limit_s * 1e3:g} ms"


def parse_budget(text: str) -> Budget:
    """The budget in a text like p99=50ms.

    Raises:
        SettingsError: It is another text.
    """
    match = re.fullmatch(r"p(\d{1,2}(?:\.\d{1,3})?)=(.+)", text)
    if match is None or float(match[1]) == 0:
        raise SettingsError(f"expected a budget like p99=50ms, got {text!r:.80}")
    return Budget(float(match[1]) / 100, seconds_of(match[2]))


def judge(budget: Budget, requests: int, in_budget: int, lag_p99_s: float) -> Verdict:
    """Whether a run held its budget, or says more of the tool than of the target."""
    if lag_p99_s > budget.limit_s / LAG_SHARE:
        return Verdict.TOOL_TOO_SLOW
    return Verdict.HELD if in_budget >= budget.wanted(requests) else Verdict.NOT_HELD
