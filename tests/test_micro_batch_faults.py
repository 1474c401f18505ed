"""Whose failure is whose among calls that share a run, and who may end without taking others along."""

import logging
import queue
import signal
import threading

import pytest

from builders_batches import DEADLY, POISON, Network, right, rows, tried, under_way, until
from shipshape import micro_batches
from shipshape.micro_batches import Arrays


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
