"""Calls that meet become one run: who waits for whom, and what a run holds."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import properties
from builders_batches import LONG_S, POISON, Network, Outcome, right, rows, tried, under_way, until
from shipshape.micro_batches import BUCKETS, Arrays, MicroBatches


def test_a_call_alone_is_its_own_run() -> None:
    network = Network()
    batches = tried(network)
    right(batches.run(rows(3.0)), rows(3.0))
    assert network.sizes == [1]


@pytest.mark.parametrize(("calls", "padded"), [(1, 1), (2, 2), (3, 4), (5, 8), (17, 32), (32, 32)])
def test_calls_that_meet_are_one_run_padded_to_a_bucket(calls: int, padded: int) -> None:
    network = Network()
    batches = tried(network)
    with under_way(network, batches) as call:
        asked = [rows(float(value)) for value in range(calls)]
        futures = [call(inputs) for inputs in asked]
        assert not any(future.done for future in futures)
    for future, inputs in zip(futures, asked, strict=True):
        right(future.result(), inputs)
    assert network.sizes == [1, padded]
    assert (batches.runs, batches.rows) == (2, 1 + calls)


def test_the_network_runs_once_at_a_time() -> None:
    turns, sizes = threading.Semaphore(0), []

    def network(inputs: Arrays) -> list[np.ndarray]:
        sizes.append(len(inputs["x"]))
        assert turns.acquire(timeout=LONG_S)
        return [2 * inputs["x"], inputs["x"].sum(axis=1)]

    turns.release(2)
    batches = MicroBatches(network, buckets=(1, 2))
    outcomes = [Outcome(batches, rows(0.0))]  # tries both buckets, and then waits for its own turn
    until(lambda: len(sizes) == 3)
    outcomes.append(Outcome(batches, rows(1.0)))
    until(lambda: len(batches._line) == 1)
    turns.release()
    until(lambda: len(sizes) == 4)  # the second call has the network
    outcomes.append(Outcome(batches, rows(2.0)))
    until(lambda: len(batches._line) == 1 or len(sizes) == 5)
    assert len(sizes) == 4
    turns.release(2)
    for value, outcome in enumerate(outcomes):
        right(outcome.result(), rows(float(value)))


def test_no_run_is_larger_than_the_largest_bucket_and_those_who_came_first_go_first() -> None:
    network = Network()
    batches = tried(network, buckets=(1, 2, 4))
    with under_way(network, batches) as call:
        futures = [call(rows(*values)) for values in ((1, 1), (2,), (3, 3), (4,), (5, 5, 5))]
    for future, values in zip(futures, ((1, 1), (2,), (3, 3), (4,), (5, 5, 5)), strict=True):
        right(future.result(), rows(*values))
    # 2 + 1 + 1 rows fit, the pair and the three do not, and go by themselves.
    assert network.sizes == [1, 4, 2, 4]


def test_a_call_larger_than_the_largest_bucket_is_padded_to_a_multiple_of_it() -> None:
    network = Network()
    batches = tried(network, buckets=(1, 2, 4))
    inputs = rows(*range(9))
    right(batches.run(inputs), inputs)
    assert network.sizes == [12]


def test_calls_of_another_shape_or_dtype_are_not_mixed() -> None:
    network = Network()
    batches = tried(network)
    wide, double = rows(7.0, width=5), {"x": np.full((1, 3), 8.0)}
    with under_way(network, batches) as call:
        futures = [call(inputs) for inputs in (rows(1.0), wide, rows(2.0), double, wide)]
    for future, inputs in zip(futures, (rows(1.0), wide, rows(2.0), double, wide), strict=True):
        right(future.result(), inputs)
    assert futures[3].result()[0].dtype == np.float64
    assert network.sizes == [1, 2, 2, 1]


def test_answers_may_be_written_into() -> None:
    network = Network()
    batches = tried(network)
    with under_way(network, batches) as call:
        futures = [call(rows(1.0)), call(rows(2.0))]
    futures[0].result()[0][:] = 99.0
    right(futures[1].result(), rows(2.0))


CALLS = st.lists(
    st.tuples(st.integers(1, 40), st.sampled_from([2, 3]), st.sampled_from([False, False, False, True])),
    min_size=1,
    max_size=40,
)


@properties(40)
@given(CALLS, st.sampled_from([(1,), (1, 2), (1, 2, 4, 8), BUCKETS]), st.integers(1, 16))
def test_every_call_gets_its_own_answer_whoever_it_meets(
    calls: list[tuple[int, int, bool]], buckets: tuple[int, ...], threads: int
) -> None:
    network = Network()
    batches = MicroBatches(network, buckets=buckets)
    asked = [
        rows(*[index + 0.5] * (count - bad), *[POISON] * bad, width=width)
        for index, (count, width, bad) in enumerate(calls)
    ]
    network.open.clear()  # until as many wait as there are threads: they meet
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(batches.run, inputs) for inputs in asked]
        until(lambda: buckets == (1,) or len(batches._line) == min(threads, len(calls)) - 1)
        network.open.set()
    for future, inputs, (_, _, bad) in zip(futures, asked, calls, strict=True):
        if bad:
            assert isinstance(future.exception(), ValueError)
        else:
            right(future.result(), inputs)
    assert not batches._busy
    assert not batches._line
    if not any(bad for _, _, bad in calls) and len(buckets) > 1:
        assert {size for size in network.sizes if size not in buckets and size % buckets[-1]} == set()
