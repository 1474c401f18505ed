"""Is the latency budget held? Told answer by answer, known at any moment, without anything that scrapes.

Two tiers, as diagnostics of autonomous vehicles have them: WARN for a while after one answer that was over budget,
ERROR when the last good answer is too old although answers were asked for. And the burn: how fast the share of
answers that may be bad is being used up; 1 is just as fast as allowed.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

WARN_S = 10.0  # that one bad answer is remembered
ERROR_S = 1.0  # without a good answer while bad ones came
OBJECTIVE = 0.99  # share of answers that have to be good
WINDOWS = {"5m": 300.0, "1h": 3600.0}
_STEP_S = 10.0  # answers of so long are counted together


class Level(StrEnum):
    """How the budget is doing."""

    OK = "ok"
    WARN = "warn"
    ERROR = "error"


@dataclass(slots=True)
class _Step:
    start: float
    good: int = 0
    bad: int = 0


@dataclass(frozen=True, slots=True)
class Report:
    """The state of the budget.

    Attributes:
        level: See the module.
        budget_s: That an answer may take, seconds.
        good: Answers inside the budget since the start.
        bad: Answers over it, refusals, expiries and faults of ours since the start.
        last_good_s: Seconds since the last good answer; None before the first.
        burn: Of the error budget in each of WINDOWS; 0 where nothing was asked.
    """

    level: Level
    budget_s: float
    good: int
    bad: int
    last_good_s: float | None
    burn: dict[str, float]


class Budget:
    """Counts answers against the budget. Safe to use from any thread.

    Args:
        budget_s: That an answer may take, seconds.
        clock: Monotonic seconds.
    """

    def __init__(self, budget_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.budget_s = budget_s
        self._clock = clock
        self._lock = threading.Lock()  # guards everything below
        self._steps: deque[_Step] = deque(maxlen=int(max(WINDOWS.values()) / _STEP_S) + 1)
        self._good = self._bad = 0
        self._last_good: float | None = None
        self._last_bad: float | None = None
        self._bad_since: float | None = None  # the first bad one after the last good one

    def tell(self, seconds: float, *, answered: bool) -> bool:
        """One request ended after `seconds`, with or without an answer; whether that was good."""
        good = answered and seconds <= self.budget_s
        with self._lock:
            now = self._clock()
            if not self._steps or now - self._steps[-1].start >= _STEP_S:
                self._steps.append(_Step(now))
            if good:
                self._good += 1
                self._steps[-1].good += 1
                self._last_good, self._bad_since = now, None
            else:
                self._bad += 1
                self._steps[-1].bad += 1
                self._last_bad = now
                self._bad_since = now if self._bad_since is None else self._bad_since
        return good

    def report(self) -> Report:
        """The state now."""
        with self._lock:
            now = self._clock()
            return Report(
                self._level(now),
                self.budget_s,
                self._good,
                self._bad,
                None if self._last_good is None else now - self._last_good,
                {name: self._burn(now, seconds) for name, seconds in WINDOWS.items()},
            )

    def _level(self, now: float) -> Level:
        if self._bad_since is not None:
            without_good = now - (self._bad_since if self._last_good is None else self._last_good)
            if without_good > ERROR_S:
                return Level.ERROR
        if self._last_bad is not None and now - self._last_bad <= WARN_S:
            return Level.WARN
        return Level.OK

    def _burn(self, now: float, seconds: float) -> float:
        recent = [step for step in self._steps if now - step.start <= seconds]
        bad, all_ = sum(step.bad for step in recent), sum(step.good + step.bad for step in recent)
        return bad / all_ / (1.0 - OBJECTIVE) if all_ else 0.0
