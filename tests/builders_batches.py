"""A network whose runs a test can hold up, and calls that meet at it."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager

import numpy as np

from shipshape.micro_batches import Arrays, MicroBatches

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
