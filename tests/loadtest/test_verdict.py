"""From records to a verdict, and from verdicts to the highest rate."""

import base64
import itertools

import numpy as np
import pytest
from hdrh.histogram import HdrHistogram
from hypothesis import given
from hypothesis import strategies as st

from loadtest.simulated import CLUSTER, plan_of, recorded
from shipshape.errors import SettingsError
from shipshape.loadtest.budget import Budget, Verdict, judge, parse_budget
from shipshape.loadtest.latency import latency_of
from shipshape.loadtest.mixture import Mixture, cut
from shipshape.loadtest.outcomes import Outcome, Reply, answered_on, worst
from shipshape.loadtest.records import MOST_COMPLAINTS, merged, unsent
from shipshape.loadtest.report import sentence_on
from shipshape.loadtest.summary import summarise
from shipshape.loadtest.sweep import highest_held

BUDGET = Budget(0.99, 0.05)


@pytest.mark.parametrize(
    ("text", "budget", "fewest"),
    [("p99=50ms", (0.99, 0.05), 100), ("p50=1s", (0.5, 1.0), 2), ("p99.9=2ms", (0.999, 0.002), 1000)],
)
def test_budgets(text, budget, fewest):
    found = parse_budget(text)
    assert (found.share, found.limit_s) == pytest.approx(budget)
    assert found.fewest == fewest


@pytest.mark.parametrize("text", ["", "50ms", "p99", "p0=1s", "p100=1s", "p99=", "p99=0ms", "q99=1s", "p-1=1s"])
def test_what_is_no_budget_is_refused(text):
    with pytest.raises(SettingsError, match=r"^expected a (budget|time) like"):
        parse_budget(text)


@given(requests=st.integers(100, 100_000), share=st.sampled_from([0.5, 0.9, 0.99, 0.999]))
def test_a_budget_is_held_by_its_share_of_requests_and_not_by_one_less(requests, share):
    budget = Budget(share, 0.05)
    late = int(requests * round((1 - share) * 1000) // 1000)
    assert judge(budget, requests, requests - late, 0.0) is Verdict.HELD
    assert judge(budget, requests, requests - late - 1, 0.0) is Verdict.NOT_HELD


def test_a_tool_that_lags_by_more_than_a_tenth_of_the_limit_says_nothing_of_the_target():
    assert judge(BUDGET, 100, 100, 0.0049) is Verdict.HELD
    assert judge(BUDGET, 100, 100, 0.0051) is Verdict.TOOL_TOO_SLOW


def test_exit_codes():
    assert [verdict.exit_code for verdict in Verdict] == [0, 1, 3]


def test_outcomes_are_counted_apart():
    plan = plan_of(100.0, 7.0)
    outcomes = np.repeat(list(Outcome), 100)
    records = recorded(plan, 0.01, outcomes)
    run = summarise(plan, records, BUDGET)
    assert run.outcomes == {outcome.label: 100 for outcome in Outcome}
    assert run.in_budget == 200  # ok and degraded
    assert run.offered == pytest.approx(100)
    assert run.throughput == run.goodput == pytest.approx(200 / 7, rel=1e-3)
    assert (run.latency.count, run.refusal.count, run.lag.count) == (200, 100, 600)
    assert run.refusal.percentiles["p50"] == pytest.approx(10, rel=0.01)
    assert sum(part.outcomes["refused"] for part in run.timeline) == 100
    assert [part.outcomes["refused"] for part in run.timeline] == [0, 0, 100, 0, 0, 0, 0]


def test_late_answers_are_throughput_but_no_goodput():
    plan = plan_of(100.0, 10.0, contacts=3)
    run = summarise(plan, recorded(plan, np.where(plan.due < 5, 0.01, 0.06)), BUDGET)
    assert run.contacts == 3000
    assert run.throughput == pytest.approx(300, rel=0.01)
    assert run.goodput == pytest.approx(150, rel=0.01)
    assert run.timeline[0].p99 == pytest.approx(10)
    assert run.timeline[9].p50 == pytest.approx(60)


def test_groups_are_told_apart():
    mixture = Mixture(cut([CLUSTER], {5: 1.0, 9: 1.0}, np.random.default_rng(0)), {"a": 1.0, "b": 1.0})
    plan = plan_of(100.0, 5.0, mixture=mixture)
    small = np.array([len(plan.requests[index].clusters[0]) == 5 for index in plan.request])
    run = summarise(plan, recorded(plan, np.where(small, 0.01, 0.2)), BUDGET)
    groups = {group.name: group for group in run.groups}
    assert set(groups) == {"5 points", "9 points", "lane a", "lane b"}
    assert groups["5 points"].in_budget == groups["5 points"].requests == small.sum()
    assert groups["9 points"].in_budget == 0
    assert groups["lane a"].requests + groups["lane b"].requests == 500


@given(st.lists(st.floats(1e-5, 100.0), min_size=1, max_size=300))
def test_percentiles_are_those_of_the_times(seconds):
    found = latency_of(np.array(seconds))
    ordered = np.sort(seconds) * 1e3
    for name, percentile in (("p50", 50), ("p90", 90), ("p99", 99)):
        exact = np.percentile(ordered, percentile, method="inverted_cdf")
        assert found.percentiles[name] == pytest.approx(exact, rel=2e-3, abs=1e-3)
    assert found.curve[0][1] == pytest.approx(ordered[0], rel=2e-3, abs=1e-3)
    assert [ms for _, ms in found.curve] == sorted(ms for _, ms in found.curve)


def test_the_histogram_can_be_read_by_others():
    found = latency_of(np.full(1000, 0.025))
    base64.b64decode(found.hdr, validate=True)
    assert HdrHistogram.decode(found.hdr).get_value_at_percentile(50) == pytest.approx(25_000, rel=1e-3)


def test_nothing_measured_is_null_not_zero():
    found = latency_of(np.empty(0))
    assert (found.count, found.mean, found.max, found.curve) == (0, None, None, [])
    assert set(found.percentiles.values()) == {None}


def test_the_records_of_several_processes_become_one():
    plan = plan_of(100.0, 1.0)
    parts = [recorded(plan.part(index, 3), 0.01 * (index + 1)) for index in range(3)]
    whole = merged(parts)
    assert whole.due == pytest.approx(plan.due)
    assert (whole.done - whole.due)[:4] == pytest.approx([0.01, 0.02, 0.03, 0.01])


def test_the_first_complaints_are_kept_each_once():
    records = unsent(plan_of(100.0, 1.0))
    for index in range(50):
        records.close(index, 0.0, 0.1, Reply(Outcome.ERROR, f"sentence {index // 2}" + "x" * 1000))
    assert len(set(records.complaints)) == len(records.complaints) == MOST_COMPLAINTS
    assert all(len(complaint) < 250 for complaint in records.complaints)
    assert records.complaints[0].startswith("error: sentence 0")


def test_a_scan_is_as_good_as_its_worst_contact():
    assert answered_on(["full", "full"]).outcome is Outcome.OK
    assert answered_on(["full", "heading"]).outcome is Outcome.DEGRADED
    assert answered_on([]).outcome is Outcome.OK  # a server without a ladder
    for outcomes in itertools.combinations(Outcome, 2):
        assert worst([Reply(outcome) for outcome in outcomes]).outcome is outcomes[1]


def test_the_sentence_says_what_was_found():
    plan = plan_of(100.0, 10.0)
    good = sentence_on(summarise(plan, recorded(plan, 0.01), BUDGET))
    assert good.startswith("held: 100.00% of 1000 requests were answered within 50 ms of when they were due, 99%")
    capped = recorded(plan, 0.01, np.where(plan.due < 5, Outcome.OK, Outcome.UNSENT))
    assert "not held: 50.00% of 1000" in sentence_on(summarise(plan, capped, BUDGET))
    assert "500 were never sent" in sentence_on(summarise(plan, capped, BUDGET))
    slow = sentence_on(summarise(plan, recorded(plan, 0.01, lag_s=0.009), BUDGET))
    assert "too slow to tell: it sent with a p99 lag of 9.01 ms, more than 5 ms" in slow


@given(capacity=st.floats(1.0, 50_000), first=st.floats(1.0, 5_000))
def test_the_highest_rate_is_found_from_wherever_it_starts(capacity, first):
    tried = []
    found = highest_held(lambda rate: tried.append(rate) or rate <= capacity, first)
    assert found <= capacity < found * 1.0501
    assert len(tried) == len(set(tried)) < 40


@pytest.mark.parametrize("first", [0.5, 1.0, 100.0])
def test_a_target_that_holds_nothing_has_no_highest_rate(first):
    assert highest_held(lambda rate: False, first) == 0.0
