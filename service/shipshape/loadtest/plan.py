"""Everything that will be sent, and when, before anything is."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from shipshape.loadtest.arrivals import Arrivals
from shipshape.loadtest.mixture import Mixture, Request

Draw = Callable[[float, np.random.Generator], Arrivals]  # seconds, rng -> the arrivals of so long


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Requests in the order in which they are due.

    Attributes:
        due: Seconds after the start of what is counted; what is due before 0 warms up.
        request: Of each arrival, its place in `requests`.
        requests: What is sent, each perhaps many times.
        seconds: How long requests that count are due.
        deadline_s: What each request is given, from its sending.
        most_under_way: Requests that one process may have under way; what is due beyond is not sent.
    """

    due: Float64[np.ndarray, " n"]
    request: Int64[np.ndarray, " n"]
    requests: tuple[Request, ...]
    seconds: float
    deadline_s: float
    most_under_way: int

    @property
    def contacts(self) -> Int64[np.ndarray, " n"]:
        """Contacts of each arrival."""
        sizes = [len(request.clusters) for request in self.requests]
        return np.take(np.array(sizes, np.int64), self.request)

    def part(self, index: int, parts: int) -> "Plan":
        """Every `parts`-th arrival from `index` on, for one of several processes."""
        return replace(
            self,
            due=self.due[index::parts],
            request=self.request[index::parts],
            most_under_way=max(1, self.most_under_way // parts),
        )


@dataclass(frozen=True, slots=True)
class Terms:
    """What holds for all requests of a plan; see `Plan`."""

    seconds: float
    warmup_s: float
    deadline_s: float
    most_under_way: int


def make_plan(draw: Draw, mixture: Mixture, terms: Terms, rng: np.random.Generator) -> Plan:
    """Draw the arrivals, and for each what it sends."""
    arrivals = draw(terms.warmup_s + terms.seconds, rng)
    requests: list[Request] = []
    chosen = np.empty(len(arrivals.seconds), np.int64)
    for contacts in np.unique(arrivals.contacts).tolist():
        found, weights = mixture.requests(contacts, rng)
        where = arrivals.contacts == contacts
        chosen[where] = len(requests) + rng.choice(len(found), int(where.sum()), p=weights)
        requests += found
    return Plan(
        arrivals.seconds - terms.warmup_s,
        chosen,
        tuple(requests),
        terms.seconds,
        terms.deadline_s,
        terms.most_under_way,
    )
