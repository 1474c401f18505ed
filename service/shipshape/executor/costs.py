"""What each stage costs, learned while it runs: seconds = a + b x size, with the past slowly forgotten."""

import weakref
from collections.abc import Iterable

MEMORY = 200  # observations after which one has lost most of its weight
MOST = 10.0  # times what was expected, that one observation counts for: a thread may lose its core for long
_FEW, _LEAST_S = 4, 1e-5  # observations before which nothing is expected; what is never too long
_NO_SPREAD = 1e-9  # of sizes: below it, nothing is known of a slope


class _Line:
    """Exponentially weighted regression of seconds on size."""

    __slots__ = ("covariance", "seconds", "seen", "size", "slope", "variance")

    def __init__(self) -> None:
        self.seen = 0
        self.size = self.seconds = 0.0  # means
        self.variance = self.covariance = self.slope = 0.0

    def learn(self, size: float, seconds: float) -> None:
        """One more observation."""
        if self.seen >= _FEW:
            seconds = min(seconds, MOST * max(self.at(size), _LEAST_S))
        self.seen += 1
        weight = max(1.0 / self.seen, 2.0 / MEMORY)  # the first ones count alike, so that it is soon right
        off_size, off_seconds = size - self.size, seconds - self.seconds
        self.size += weight * off_size
        self.seconds += weight * off_seconds
        self.variance = (1.0 - weight) * (self.variance + weight * off_size * off_size)
        self.covariance = (1.0 - weight) * (self.covariance + weight * off_size * off_seconds)
        self.slope = max(0.0, self.covariance / self.variance) if self.variance > _NO_SPREAD else 0.0

    def at(self, size: float) -> float:
        """Seconds expected at this size, never less for more."""
        return max(0.0, self.seconds + self.slope * (size - self.size))


class Costs:
    """The fitted cost of everything that was timed, by the object that was. Not thread-safe: hold the lock.

    What nobody uses any more, such as the stages of a model that was replaced, is forgotten by itself.
    """

    def __init__(self) -> None:
        # By id: looking into a dictionary of weak keys takes longer than all else that admission does.
        self._lines: dict[int, _Line] = {}

    def learn(self, timed: object, size: float, seconds: float) -> None:
        """It took `seconds` for work of this size."""
        if (line := self._lines.get(id(timed))) is None:
            line = self._lines[id(timed)] = _Line()
            weakref.finalize(timed, self._lines.pop, id(timed), None)
        line.learn(size, seconds)

    def of(self, timed: object, size: float) -> float:
        """Seconds that it will probably take; 0 for what was never timed."""
        line = self._lines.get(id(timed))
        return line.at(size) if line is not None else 0.0

    def each(self, timed: Iterable[object], size: float) -> list[float]:
        """Seconds of each."""
        return [self.of(one, size) for one in timed]
