"""The command line's arguments -> what to send, to whom, and what is asked of it."""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shipshape.errors import SettingsError
from shipshape.executor import Lane
from shipshape.loadtest.arrivals import Arrivals, Times, bursts, constant, equal, poisson
from shipshape.loadtest.budget import Budget, parse_budget
from shipshape.loadtest.mixture import Mixture, cut
from shipshape.loadtest.plan import Plan, Terms, make_plan
from shipshape.loadtest.quantities import seconds_of, weights_of
from shipshape.loadtest.recording import read_recording
from shipshape.loadtest.targets.address import Address, Keys, parse_address
from shipshape.pointfiles import read_clusters
from shipshape.sample import sample_contact
from shipshape.token_file import read_token

MOST_RATE = 1e6  # contacts a second, whose schedule still fits into memory
DEFAULT_RATE = 100.0  # contacts a second, where neither --rate nor a recording says one

Draw = Callable[[float, float, np.random.Generator], Times]  # requests a second, seconds, rng
Schedule = Callable[[float | None, float, np.random.Generator], Arrivals]  # contacts a second, seconds, rng
SCHEDULES: Mapping[str, Draw] = {
    "poisson": poisson,
    "constant": lambda rate, seconds, rng: constant(rate, seconds),
}


@dataclass(frozen=True, slots=True)
class LoadTest:
    """What the command line asks for."""

    address: Address
    budget: Budget
    schedule: Schedule
    mean_contacts: float  # of one request
    mixture: Mixture
    terms: Terms
    seed: int

    def plan(self, rate: float | None, seconds: float) -> Plan:
        """The plan for a rate, contacts a second (None: the schedule's own), and a duration; the same each time.

        Raises:
            SettingsError: Too few requests to tell whether the budget is held.
        """
        plan = make_plan(
            lambda length, rng: self.schedule(rate, length, rng),
            self.mixture,
            replace(self.terms, seconds=seconds),
            np.random.default_rng(self.seed),
        )
        counted = int((plan.due >= 0).sum())
        if counted < self.budget.fewest:
            raise SettingsError(
                f"expected {self.budget.fewest} requests or more to judge {self.budget}, got {counted}: "
                "send for longer or faster"
            )
        return plan

    def long_enough(self, rate: float, seconds: float) -> float:
        """`seconds`, or as long as it takes to send twice the requests that the budget can be judged by."""
        return max(seconds, 2 * self.budget.fewest * self.mean_contacts / rate)


def options_of(arguments: argparse.Namespace) -> LoadTest:
    """The test that the arguments ask for.

    Raises:
        SettingsError: A value that cannot work.
        FileError: A file that cannot be read.
    """
    budget = parse_budget(arguments.budget)
    token = "" if arguments.token_file is None else read_token(arguments.token_file)
    keys = Keys(arguments.ca, arguments.cert, arguments.key, token)
    deadline_s = budget.limit_s if arguments.deadline is None else seconds_of(arguments.deadline)
    if arguments.rate is not None and not 0 < arguments.rate <= MOST_RATE:
        raise SettingsError(f"expected --rate above 0 and up to {MOST_RATE:.0f}, got {arguments.rate}")
    if arguments.seed < 0:
        raise SettingsError(f"expected --seed of 0 or more, got {arguments.seed}")
    if (arguments.cert is None) != (arguments.key is None):
        raise SettingsError("expected both --cert and --key, got one of them")
    for name in ("contacts", "connections", "processes", "max_outstanding"):
        _positive(str(getattr(arguments, name)), f"--{name.replace('_', '-')}")
    schedule, mean_contacts = _schedule(arguments.arrivals, arguments.contacts)
    return LoadTest(
        address=parse_address(arguments.target, keys, arguments.connections),
        budget=budget,
        schedule=schedule,
        mean_contacts=mean_contacts,
        mixture=_mixture(arguments),
        terms=Terms(
            seconds_of(arguments.duration),
            seconds_of(arguments.warmup, none=True),
            deadline_s,
            arguments.max_outstanding,
        ),
        seed=arguments.seed,
    )


def _schedule(arrivals: str, contacts: int) -> tuple[Schedule, float]:
    """The schedule of that name, and how many contacts a request has on average."""
    kind, _, size = arrivals.partition(":")
    if arrivals.endswith(".csv"):
        if contacts != 1:
            raise SettingsError(
                f"expected the contacts that {arrivals} records, got --contacts {contacts} beside it"
            )
        recording = read_recording(Path(arrivals))
        return lambda rate, seconds, rng: recording.played(rate, seconds), float(
            recording.arrivals.contacts.mean()
        )
    if kind == "bursts":
        together = _positive(size, "--arrivals bursts:N")
        return _regular(lambda rate, seconds, rng: bursts(rate, seconds, together, rng), contacts), contacts
    if arrivals not in SCHEDULES:
        raise SettingsError(
            f"expected --arrivals poisson, constant, bursts:N or a .csv file, got {arrivals!r:.80}"
        )
    return _regular(SCHEDULES[arrivals], contacts), contacts


def _regular(times: Draw, contacts: int) -> Schedule:
    return lambda rate, seconds, rng: equal(times((rate or DEFAULT_RATE) / contacts, seconds, rng), contacts)


def _mixture(arguments: argparse.Namespace) -> Mixture:
    if arguments.clusters is None:
        clusters, default = [sample_contact().points_level], "300"
    else:
        clusters, default = read_clusters(arguments.clusters), ""
    points = arguments.points or default
    sizes: Mapping[int, float] = {
        _positive(size, "--points"): weight for size, weight in (weights_of(points) if points else {}).items()
    }
    lanes = weights_of(arguments.lanes) if arguments.lanes else {"": 1.0}
    if unknown := sorted(set(lanes) - {"", *Lane}):
        raise SettingsError(f"expected --lanes of {', '.join(Lane)}, got {unknown[0]!r:.80}")
    if arguments.lanes and arguments.target.startswith("oip"):
        raise SettingsError("expected --lanes with gRPC or REST, got a target of a protocol that has none")
    return Mixture(cut(clusters, sizes, np.random.default_rng(arguments.seed)), lanes)


def _positive(text: str, what: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise SettingsError(f"expected a whole number above 0 for {what}, got {text!r:.80}")
    return int(text)
