"""What is expected of an endpoint, and which one is asked; worked out by hand, without a service."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipshape.client.answers import Capacity
from shipshape.client.links import Link
from shipshape.client.route import ENOUGH, Route, choose
from shipshape.errors import Unreachable
from shipshape.types import Rung

LINK = Link(keepalive_s=60, keepalive_timeout_s=5, probe_s=1, first_backoff_s=0.5, longest_backoff_s=4)
GONE = Unreachable("expected a service, got none")


def capacity(computing_s=0.01, wait_s=0.0, load=0.0, workers=2, budget_s=0.05):
    return Capacity({Rung.FULL: computing_s + wait_s}, wait_s, load, workers, budget_s, "ok")


def route(name="a", **told):
    made = Route(name, LINK, random.Random(1))
    if told:
        made.told_capacity(
            capacity(**{k: v for k, v in told.items() if k != "round_trip_s"}), told["round_trip_s"]
        )
    return made


@pytest.mark.parametrize(
    ("told", "expected_s"),
    [
        ({}, 0.110),  # nobody waits
        ({"load": 0.5}, 0.110),  # one of two workers is free
        ({"load": 1.0}, 0.115),  # half a contact a worker must end first
        ({"load": 3.0, "wait_s": 0.2}, 0.135),  # the queue counts once: as load, not as the promise's wait
        ({"workers": 1, "load": 2.0}, 0.130),
    ],
)
def test_what_is_expected(told, expected_s):
    assert route(round_trip_s=0.1, **told).expected_s == pytest.approx(expected_s)


def test_calls_of_ones_own_that_are_under_way_count_before_the_service_tells_of_them():
    busy = route(round_trip_s=0.1)
    busy.outstanding = 4  # two a worker
    assert busy.expected_s == pytest.approx(0.125)


def test_nothing_is_expected_of_an_endpoint_that_was_never_asked():
    fresh = route()
    fresh.told_answer(0.3, 0.1, None)
    assert fresh.expected_s is None
    assert (fresh.budget_s, fresh.p95_s) == (None, None)


def test_round_trips_are_smoothed_and_those_behind_a_queue_are_no_round_trips():
    made = route(round_trip_s=0.1)
    made.told_answer(0.35, 0.05, 0.5)
    assert made.round_trip_s == pytest.approx(0.1 + 0.25 * 0.2)
    made.told_answer(9.0, 0.05, 7.0)
    assert made.round_trip_s == pytest.approx(0.15)
    assert made.load == 7


def test_p95_of_the_last_answers():
    made = route()
    for number in range(1, ENOUGH):
        made.told_answer(float(number), 0.0, None)
    assert made.p95_s is None
    made.told_answer(float(ENOUGH), 0.0, None)
    assert 19 < made.p95_s < 20


def test_rests_double_up_to_the_longest_and_one_answer_ends_them():
    made = route(round_trip_s=0.1)
    rests = []
    for _ in range(5):
        made.told_failure(100.0, GONE)
        rests.append(made.rests_until - 100.0)
    assert rests == [pytest.approx(s, rel=0.2) for s in (0.5, 1, 2, 4, 4)]
    made.told_answer(0.1, 0.0, None)
    assert (made.rests_until, made.failure) == (0.0, GONE)
    made.told_failure(100.0, GONE)
    assert made.rests_until == pytest.approx(100.5, abs=0.1)


@pytest.mark.parametrize(("waited_s", "rests"), [(0.15, False), (0.25, True)])
def test_silence_counts_only_when_there_was_time_to_answer(waited_s, rests):
    made = route(round_trip_s=0.1)  # 0.11 s are expected
    made.told_silence(100.0, GONE, waited_s)
    assert (made.rests_until > 100) is rests


ROUTES = st.lists(
    st.builds(
        lambda round_trip_s, computing_s, rests, known: (round_trip_s, computing_s, rests, known),
        st.floats(0.001, 1),
        st.floats(0.001, 1),
        st.booleans(),
        st.booleans(),
    ),
    max_size=5,
)


@given(ROUTES, st.floats(0.01, 3))
def test_the_choice(drawn, left_s):
    routes = []
    for round_trip_s, computing_s, rests, known in drawn:
        made = route(round_trip_s=round_trip_s, computing_s=computing_s, budget_s=0.5) if known else route()
        made.rests_until = 11.0 if rests else 0.0
        routes.append(made)
    chosen = choose(routes, 10.0, left_s)
    awake = [each for each in routes if each.rests_until == 0]
    assert (chosen is None) is (not awake)
    fitting = [each for each in awake if each.expected_s is None or each.expected_s <= min(0.5, left_s)]
    if fitting:
        assert chosen is fitting[0]
    elif awake:
        assert chosen.expected_s == min(each.expected_s for each in awake)
