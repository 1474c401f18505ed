"""Records -> what is reported of one run. Milliseconds and contacts a second unless a name says otherwise."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float64

from shipshape.loadtest.budget import Budget, Verdict, judge
from shipshape.loadtest.latency import Latency, latency_of
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.plan import Plan
from shipshape.loadtest.records import Records

MOST_SLICES = 120

Seconds = Float64[np.ndarray, " n"]
Chosen = Bool[np.ndarray, " n"]


@dataclass(frozen=True, slots=True)
class Group:
    """Requests of one size or lane."""

    name: str
    requests: int
    in_budget: int
    latency: Latency


@dataclass(frozen=True, slots=True)
class Slice:
    """Requests that were due within one part of the run."""

    start_s: float
    seconds: float
    outcomes: Mapping[str, int]
    p50: float | None
    p99: float | None


@dataclass(frozen=True, slots=True)
class Summary:
    """One run without its warm-up."""

    verdict: Verdict
    budget: Budget
    seconds: float  # from the first moment that counts to the last answer
    warmup_requests: int
    requests: int
    contacts: int
    outcomes: Mapping[str, int]  # requests; a scan as its worst contact
    in_budget: int  # requests answered within the limit, counted from when they were due
    offered: float  # contacts a second that were due
    throughput: float  # contacts a second that were answered
    goodput: float  # contacts a second that were answered within the limit
    latency: Latency  # of answers, from when their requests were due
    service: Latency  # of answers, from when their requests were sent
    refusal: Latency  # of refusals, from when their requests were sent
    lag: Latency  # from when requests were due to when they were sent
    groups: list[Group]
    timeline: list[Slice]
    complaints: list[str] = field(default_factory=list)


def summarise(plan: Plan, records: Records, budget: Budget) -> Summary:
    """The summary of a plan that was sent."""
    counted = records.due >= 0
    contacts = plan.contacts
    outcome = records.outcome
    answered = counted & (outcome <= Outcome.DEGRADED)
    waited, served, lag = records.done - records.due, records.done - records.sent, records.sent - records.due
    good = answered & (waited <= budget.limit_s)
    lags = latency_of(lag[counted & (outcome != Outcome.UNSENT)])
    seconds = max(plan.seconds, float(np.nanmax(records.done[counted], initial=0.0)))
    return Summary(
        verdict=judge(budget, int(counted.sum()), int(good.sum()), (lags.percentiles["p99"] or 0.0) / 1e3),
        budget=budget,
        seconds=seconds,
        warmup_requests=int((~counted).sum()),
        requests=int(counted.sum()),
        contacts=int(contacts[counted].sum()),
        outcomes=_outcomes(records, counted),
        in_budget=int(good.sum()),
        offered=float(contacts[counted].sum()) / plan.seconds,
        throughput=float(contacts[answered].sum()) / seconds,
        goodput=float(contacts[good].sum()) / seconds,
        latency=latency_of(waited[answered]),
        service=latency_of(served[answered]),
        refusal=latency_of(served[counted & (outcome == Outcome.REFUSED)]),
        lag=lags,
        groups=_groups(plan, counted, good, answered, waited),
        timeline=_timeline(plan, records, counted, answered, waited),
        complaints=records.complaints,
    )


def _outcomes(records: Records, which: Chosen) -> dict[str, int]:
    counts = np.bincount(records.outcome[which], minlength=len(Outcome)).tolist()
    return {outcome.label: counts[outcome] for outcome in Outcome}


def _groups(plan: Plan, counted: Chosen, good: Chosen, answered: Chosen, waited: Seconds) -> list[Group]:
    members: dict[str, list[int]] = {}
    for index, request in enumerate(plan.requests):
        for label in request.labels:
            members.setdefault(label, []).append(index)
    groups = []
    for name in sorted(members, key=lambda name: name.startswith("lane ")):  # sizes first
        inside = counted & np.isin(plan.request, members[name])
        latency = latency_of(waited[inside & answered])
        groups.append(Group(name, int(inside.sum()), int((inside & good).sum()), latency))
    return groups


def _timeline(plan: Plan, records: Records, counted: Chosen, answered: Chosen, waited: Seconds) -> list[Slice]:
    width = max(1.0, plan.seconds / MOST_SLICES)
    place = np.floor(records.due / width).astype(np.int64)
    slices = []
    for index in range(int(np.ceil(plan.seconds / width))):
        here = counted & (place == index)
        times = waited[here & answered] * 1e3
        p50, p99 = np.percentile(times, (50, 99)).tolist() if len(times) else (None, None)
        slices.append(Slice(index * width, width, _outcomes(records, here), p50, p99))
    return slices
