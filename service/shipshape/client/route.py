"""What is known of one endpoint: how far it is, how busy, and whether it failed a moment ago."""

import random
import statistics
from collections import deque
from collections.abc import Sequence

from shipshape.client.answers import Capacity
from shipshape.client.links import Link
from shipshape.errors import ShipshapeError

NEWEST = 0.25  # weight of a new round trip in the smoothed one
REMEMBERED, ENOUGH = 200, 20  # answers: of which p95 is taken, and with fewer of which there is none
PATIENCE = 2.0  # times what was expected: one that is silent for longer is left alone


class Route:
    """One endpoint, as its answers tell it. Not thread-safe: it belongs to one event loop.

    Args:
        url: Of the endpoint.
        link: How long failures keep it out.
        dice: For the jitter of rests, which keeps many clients from coming back at once.
    """

    def __init__(self, url: str, link: Link, dice: random.Random) -> None:
        self.url = url
        self.link = link
        self.outstanding = 0  # calls of this client under way
        self.rests_until = 0.0  # on the caller's clock
        self.failure: ShipshapeError | None = None  # why it rests, or rested last
        self.round_trip_s: float | None = None
        self.load: float | None = None
        self._dice = dice
        self._capacity: Capacity | None = None
        self._failures = 0
        self._took_s: deque[float] = deque(maxlen=REMEMBERED)

    def told_capacity(self, capacity: Capacity, round_trip_s: float) -> None:
        """It answered a probe, after so many seconds."""
        self._capacity, self.load = capacity, capacity.load
        self._told_round_trip(round_trip_s)
        self._well()

    def told_answer(self, took_s: float, stages_s: float, load: float | None) -> None:
        """It answered a contact.

        Args:
            took_s: Seconds, as the caller saw it.
            stages_s: Of these, seconds of computing; 0: not known.
            load: As it reported beside the answer, contacts a worker.
        """
        self._took_s.append(took_s)
        self.load = self.load if load is None else load
        if stages_s and load is not None and load < 1:  # nobody waited: all the rest is the way there and back
            self._told_round_trip(max(0.0, took_s - stages_s))
        self._well()

    def told_failure(self, now: float, why: ShipshapeError) -> None:
        """It was not there, or of no use; each time in a row it is left alone for longer."""
        self.failure = why
        rest = min(self.link.longest_backoff_s, self.link.first_backoff_s * 2.0**self._failures)
        self._failures = min(self._failures + 1, 32)
        self.rests_until = now + rest * self._dice.uniform(0.8, 1.2)

    def told_silence(self, now: float, why: ShipshapeError, waited_s: float) -> None:
        """It did not answer within the deadline, which may have been too short for it."""
        if waited_s >= PATIENCE * (self.expected_s or 0.0):
            self.told_failure(now, why)

    @property
    def expected_s(self) -> float | None:
        """Seconds until the answer to a contact sent now; None: not known yet."""
        if self._capacity is None or self.round_trip_s is None or not self._capacity.promises:
            return None
        computing = max(0.0, next(iter(self._capacity.promises.values())) - self._capacity.wait_s)
        workers = max(1, self._capacity.workers)
        load = max(self.load or 0.0, self.outstanding / workers)
        ahead = max(0.0, load + 1 / workers - 1)  # contacts a worker that must end before a worker is free
        return self.round_trip_s + computing * (1 + ahead)

    @property
    def budget_s(self) -> float | None:
        """Seconds that an answer of this service is meant to take; None: not known yet."""
        return self._capacity.budget_s if self._capacity else None

    @property
    def p95_s(self) -> float | None:
        """Within which 95 of the last 100 answers came; None: too few came yet."""
        if len(self._took_s) < ENOUGH:
            return None
        return statistics.quantiles(self._took_s, n=20)[-1]

    def _told_round_trip(self, seconds: float) -> None:
        before = seconds if self.round_trip_s is None else self.round_trip_s
        self.round_trip_s = before + NEWEST * (seconds - before)

    def _well(self) -> None:
        self._failures, self.rests_until = 0, 0.0


def choose(routes: Sequence[Route], now: float, left_s: float) -> Route | None:
    """The first that is expected to answer within its budget and the time left, else the quickest; None: all rest.

    One of which nothing is known yet is taken to hold its budget, so that it gets known.
    """
    awake = [route for route in routes if route.rests_until <= now]
    for route in awake:
        if route.expected_s is None or route.expected_s <= min(left_s, route.budget_s or left_s):
            return route
    return min(awake, key=lambda route: route.expected_s or 0.0, default=None)
