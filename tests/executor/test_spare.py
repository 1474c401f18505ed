"""Spare tasks, which no caller asked for: no caller can tell that they are there."""

import gc
import threading
import weakref

import pytest

from executor.test_executor import PATIENCE, Gate, Note, Steps, task
from shipshape.errors import Overloaded
from shipshape.executor import Executor, Lane

LIMIT = 4


@pytest.fixture
def threads():
    executor = Executor(workers=1, queue_limit=LIMIT)
    yield executor
    executor.stop(PATIENCE)


def spare(*stages, **fields):
    return task(*stages, lane=Lane.BATCH, spare=True, **fields)


def test_they_are_counted_apart(threads):
    failing = spare(Note("a", lambda item: 1 / 0))
    tickets = [threads.submit(each) for each in (spare(Note("a")), failing, task(Note("a")))]
    for ticket in tickets:
        ticket.future.exception(PATIENCE)
    own, callers = threads.counts(spare=True), threads.counts()
    assert (own.offered, own.completed, own.failed, own.pending) == (2, 1, 1, 0)
    assert (callers.offered, callers.completed, callers.failed, callers.pending) == (1, 1, 0, 0)


def test_waiting_is_observed_of_callers_alone():
    lanes = []
    executor = Executor(1, LIMIT, on_wait=lambda lane, seconds: lanes.append(lane))
    executor.submit(spare(Note("a"))).result()
    executor.submit(task(Note("a"))).result()
    executor.stop(PATIENCE)
    assert lanes == [Lane.TRACKING]


def test_they_take_no_place_in_a_full_queue(threads):
    gate = Gate()
    held = threads.submit(task(gate, lane=Lane.COLLISION))
    assert gate.entered.acquire(timeout=PATIENCE)
    own = threads.submit(spare(Note("a")))
    waiting = [threads.submit(task(Note("a"), lane=Lane.COLLISION)) for _ in range(LIMIT)]
    with pytest.raises(Overloaded):
        threads.submit(task(Note("a"), lane=Lane.COLLISION))
    more = threads.submit(spare(Note("a")))
    gate.opened.set()
    for ticket in (held, own, more, *waiting):
        ticket.result()


def test_they_take_no_time_in_what_others_are_promised(threads):
    slow = Note("slow")
    rung = Steps(slow)
    threads.learn([(slow, 5.0)] * 10, 0.0)
    assert threads.promise(rung, 0.0, Lane.BATCH) >= 5.0
    gate = Gate()
    held = threads.submit(spare(gate, slow))
    assert gate.entered.acquire(timeout=PATIENCE)
    other = threads.submit(spare(slow))
    for lane in Lane:
        assert threads.wait(lane) == 0
    gate.opened.set()
    held.result()
    other.result()


def test_they_give_way_between_two_stages(threads):
    gate, order = Gate(), []
    own = threads.submit(spare(gate, Note("b", lambda item: order.append("spare"))))
    assert gate.entered.acquire(timeout=PATIENCE)
    urgent = threads.submit(task(Note("a", lambda item: order.append("caller"))))
    gate.opened.set()
    urgent.result()
    own.result()
    assert order == ["caller", "spare"]


def test_what_a_task_knew_is_let_go_of_when_it_has_ended(threads):
    """Without a collection: a replaced model must not wait for one."""
    freed = threading.Event()
    finish = type("Finish", (), {"__call__": lambda self, work, ended: "answer"})()
    weakref.finalize(finish, freed.set)
    gc.disable()
    try:
        ticket = threads.submit(task(Note("a"), finish=finish))
        del finish
        assert ticket.result() == "answer"
        assert freed.wait(PATIENCE)
    finally:
        gc.enable()
