"""When requests are due: drawn beforehand, whatever the target does."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

Times = Float64[np.ndarray, " n"]


@dataclass(frozen=True, slots=True)
class Arrivals:
    """Moments in ascending order, seconds after the start, and the contacts that arrive at each."""

    seconds: Times
    contacts: Int64[np.ndarray, " n"]


def poisson(rate: float, seconds: float, rng: np.random.Generator) -> Times:
    """Independent arrivals, `rate` a second on average: what many callers that know nothing of each other send."""
    return np.sort(rng.uniform(0.0, seconds, rng.poisson(rate * seconds)))


def constant(rate: float, seconds: float) -> Times:
    """One arrival every 1 / `rate` seconds, from 0 on."""
    return np.arange(np.ceil(rate * seconds), dtype=np.float64) / rate


def bursts(rate: float, seconds: float, size: int, rng: np.random.Generator) -> Times:
    """`size` arrivals at once, at independent moments; `rate` counts arrivals, not bursts."""
    return np.repeat(poisson(rate / size, seconds, rng), size)


def equal(times: Times, contacts: int) -> Arrivals:
    """Arrivals of `contacts` contacts each."""
    return Arrivals(times, np.full(len(times), contacts, np.int64))


@dataclass(frozen=True, slots=True)
class Recording:
    """Arrivals as they were once recorded, from 0 on; they come again every `period_s` seconds.

    Moments without a contact are left out; they only count for the period.
    """

    arrivals: Arrivals
    period_s: float

    @property
    def rate(self) -> float:
        """Contacts a second, on average."""
        return float(self.arrivals.contacts.sum() / self.period_s)

    def played(self, rate: float | None, seconds: float) -> Arrivals:
        """The arrivals of `seconds` seconds; faster or slower as a whole when `rate` asks for it."""
        speed = 1.0 if rate is None else rate / self.rate
        rounds = int(np.ceil(seconds * speed / self.period_s))
        starts = np.repeat(np.arange(rounds) * self.period_s, len(self.arrivals.seconds))
        times = (starts + np.tile(self.arrivals.seconds, rounds)) / speed
        contacts = np.tile(self.arrivals.contacts, rounds)
        return Arrivals(times[times < seconds], contacts[times < seconds])
