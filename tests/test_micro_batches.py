"""Calls that meet become one run: who waits for whom, what a run holds, and whose failure is whose."""

import logging
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import properties
from shipshape import micro_batches
from shipshape.micro_batches import BUCKETS, Arrays, MicroBatches

LONG_S = 60.0  # for what must happen, and does so at once unless something is broken
POISON, DEADLY = -1.0, -2.0  # rows that no network survives; the second ends the thread


class Network:
    """Doubles its rows and adds up each, slowly if it is told to; remembers how many rows came."""

    def __init__(self) -> None:
        self.sizes: list[int] = []
        self.open = threading.Event()
        self.open.set()

    def __call__(self, inputs: Arrays) -> list[np.ndarray]:
        x = inputs["x"]
        self.sizes.append(len(x))
        self.open.wait(LONG_S)
        if (x == POISON).any():
            raise ValueError("poison")
        if (x == DEADLY).any():
            raise SystemExit("the thread has to end")
        return [2 * x, x.reshape(len(x), -1).sum(axis=1)]


def rows(*values: float, width: int = 3) -> dict[str, np.ndarray]:
    """One row a value, all of it that value."""
    return {"x": np.repeat(np.array(values, np.float32)[:, None], width, axis=1)}


def right(outputs: Sequence[np.ndarray], inputs: Arrays) -> None:
    """The answer to these rows and no others."""
    np.testing.assert_array_equal(outputs[0], 2 * inputs["x"])
    np.testing.assert_array_equal(outputs[1], inputs["x"].sum(axis=1))


def tried(network: Network, **options: object) -> MicroBatches:
    """Batches whose first call, which runs all buckets, is over."""
    batches = MicroBatches(network, **options)
    right(batches.run(rows(1.0)), rows(1.0))
    network.sizes.clear()
    batches.runs = batches.rows = 0
    return batches


def until(true: Callable[[], bool]) -> None:
    """Wait for another thread."""
    end = time.monotonic() + LONG_S
    while not true():
        assert time.monotonic() < end, "it never came to be"
        time.sleep(1e-3)


Inputs = dict[str, np.ndarray]


class Outcome:
    """A call in a thread of its own, which a broken lock does not keep from ending with the tests."""

    def __init__(self, batches: MicroBatches, inputs: Inputs) -> None:
        self._future: Future[list[np.ndarray]] = Future()
        threading.Thread(target=self._run, args=(batches, inputs), daemon=True).start()

    def _run(self, batches: MicroBatches, inputs: Inputs) -> None:
        try:
            self._future.set_result(batches.run(inputs))
        except BaseException as error:
            self._future.set_exception(error)

    @property
    def done(self) -> bool:
        return self._future.done()

    def result(self) -> list[np.ndarray]:
        return self._future.result(LONG_S)


@contextmanager
def under_way(
    network: Network, batches: MicroBatches, first: Inputs | None = None
) -> Iterator[Callable[[Inputs], Outcome]]:
    """While the network runs the first call: hands out a way to have others stand in line, in their order.

    The run under way ends with the block.
    """
    network.open.clear()
    running = Outcome(batches, first or rows(0.5))
    until(lambda: bool(network.sizes))

    def call(inputs: Inputs) -> Outcome:
        waiting = len(batches._line)
        outcome = Outcome(batches, inputs)
        until(lambda: len(batches._line) == waiting + 1)
        return outcome

    try:
        yield call
    finally:
        network.open.set()
    if first is None:
        right(running.result(), rows(0.5))


def test_a_call_alone_is_its_own_run() -> None:
    network = Network()
    batches = tried(network)
    right(batches.run(rows(3.0)), rows(3.0))
    assert network.sizes == [1]


def test_the_first_call_runs_every_bucket_once() -> None:
    network = Network()
    right(MicroBatches(network).run(rows(1.0, 2.0, 3.0)), rows(1.0, 2.0, 3.0))
    assert network.sizes == [*BUCKETS, 4], "three rows are padded"


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


def test_a_call_that_fails_fails_alone(caplog: pytest.LogCaptureFixture) -> None:
    network = Network()
    batches = tried(network)
    with caplog.at_level(logging.WARNING), under_way(network, batches) as call:
        futures = [call(rows(value)) for value in (1.0, POISON, 2.0)]
    right(futures[0].result(), rows(1.0))
    right(futures[2].result(), rows(2.0))
    with pytest.raises(ValueError, match="poison"):
        futures[1].result()
    assert sorted(network.sizes) == [1, 1, 1, 1, 4]
    assert "failed for 3 calls at once" in caplog.text
    right(batches.run(rows(4.0)), rows(4.0))


def test_a_thread_that_has_to_end_leaves_nobody_waiting() -> None:
    network = Network()
    batches = tried(network)
    with under_way(network, batches, first=rows(DEADLY)) as call:
        futures = [call(rows(value)) for value in (DEADLY, 1.0, 2.0)]
    with pytest.raises(SystemExit):
        futures[0].result()
    right(futures[1].result(), rows(1.0))
    right(futures[2].result(), rows(2.0))
    right(batches.run(rows(3.0)), rows(3.0))


class Left(BaseException):
    """What a signal's handler may raise in a caller that waits."""


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="needs signals of one thread")
def test_a_caller_that_leaves_the_line_is_not_waited_for() -> None:
    network = Network()
    batches = tried(network)

    def leave(*_: object) -> None:
        raise Left

    def interrupt() -> None:
        until(lambda: len(batches._line) == 1)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGUSR1)

    before = signal.signal(signal.SIGUSR1, leave)
    try:
        with under_way(network, batches) as call:
            threading.Thread(target=interrupt).start()
            with pytest.raises(Left):
                batches.run(rows(9.0))
            future = call(rows(1.0))
    finally:
        signal.signal(signal.SIGUSR1, before)
    right(future.result(), rows(1.0))
    assert network.sizes == [1, 1]


def test_a_caller_that_leaves_with_the_network_in_its_hands_gives_it_to_the_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Leaving(micro_batches._Call):
        """One of whose kind is interrupted just as it is woken."""

        def __init__(self, inputs: Arrays, count: int) -> None:
            super().__init__(inputs, count)
            if (inputs["x"] == 9.0).any():
                self.woken = Interrupted()

    class Interrupted:
        def __init__(self) -> None:
            self._woken = queue.SimpleQueue()
            self.put = self._woken.put

        def get(self) -> None:
            self._woken.get()
            raise Left

    network = Network()
    batches = tried(network, buckets=(1, 2))
    monkeypatch.setattr(micro_batches, "_Call", Leaving)
    with under_way(network, batches) as call:
        futures = [call(rows(9.0)), call(rows(1.0)), call(rows(2.0)), call(rows(3.0)), call(rows(9.0))]
    for index in (0, 4):
        with pytest.raises(Left):
            futures[index].result()
    for future, value in zip(futures[1:4], (1.0, 2.0, 3.0), strict=True):
        right(future.result(), rows(value))
    right(batches.run(rows(4.0)), rows(4.0))


@pytest.mark.parametrize(
    "inputs",
    [
        {"x": np.zeros((2, 3), np.float32), "y": np.zeros((1, 3), np.float32)},
        {"x": np.float32(1.0)},
        {"x": np.zeros((0, 3), np.float32)},
        {},
    ],
    ids=["rows that disagree", "no dimension", "no row", "nothing"],
)
def test_inputs_without_rows_go_to_the_network_as_they_are(inputs: dict[str, np.ndarray]) -> None:
    seen = []
    batches = MicroBatches(lambda given: seen.append(given) or [])
    assert batches.run(inputs) == []
    assert seen == [inputs]


def test_bad_inputs_of_the_first_call_are_its_own_fault() -> None:
    network = Network()
    batches = MicroBatches(network)
    with pytest.raises(ValueError, match="poison"):
        batches.run(rows(POISON))
    right(batches.run(rows(1.0)), rows(1.0))
    assert batches.largest == BUCKETS[-1]


def test_a_network_without_an_answer_for_each_row_is_left_alone() -> None:
    batches = MicroBatches(lambda inputs: [inputs["x"].sum(axis=0)])
    np.testing.assert_array_equal(batches.run(rows(1.0, 2.0))[0], [3.0, 3.0, 3.0])
    assert batches.largest == 1


def test_a_device_that_has_no_memory_for_a_bucket_is_spared_it() -> None:
    def network(inputs: Arrays) -> list[np.ndarray]:
        if len(inputs["x"]) > 8:
            raise MemoryError("no room for so many")
        return [inputs["x"]]

    batches = MicroBatches(network)
    batches.run(rows(1.0))
    assert batches.largest == 8


@pytest.mark.parametrize(
    ("fixed", "each", "largest"),
    [(0.0, 1.0, 1), (0.3, 1.0, 1), (1.0, 0.0, 32), (1.0, 0.1, 8), (1.0, 0.01, 32)],
    ids=["processor", "processor, small network", "idle card", "card that fills", "card with room"],
)
def test_buckets_are_used_as_far_as_they_are_measured_to_pay(fixed: float, each: float, largest: int) -> None:
    now = [0.0]

    def network(inputs: Arrays) -> list[np.ndarray]:
        now[0] += fixed + each * len(inputs["x"])
        return [inputs["x"]]

    batches = MicroBatches(network, measured=True, clock=lambda: now[0])
    batches.run(rows(1.0))
    assert batches.largest == largest


def test_one_slow_measurement_decides_nothing() -> None:
    now, delays = [0.0], iter([0.0, 50.0, 0.0, 0.0, 0.0, 0.0])

    def network(inputs: Arrays) -> list[np.ndarray]:
        now[0] += len(inputs["x"]) + next(delays, 0.0)
        return [inputs["x"]]

    batches = MicroBatches(network, measured=True, clock=lambda: now[0])
    batches.run(rows(1.0))
    assert batches.largest == 1


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
