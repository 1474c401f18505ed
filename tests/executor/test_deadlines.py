"""Expiry that needs neither a waiter nor a free worker, and what the executor says of its own health."""

import threading

import pytest

from executor.test_executor import FAR, PATIENCE, Gate, HandClock, Note, task
from serving.fakes import until
from shipshape.errors import DeadlineExceeded
from shipshape.executor import Executor
from shipshape.executor.crew import WEDGED_S
from shipshape.executor.deadlines import FEW, Deadlines
from shipshape.executor.ticket import Ticket


@pytest.fixture
def clock():
    return HandClock()


@pytest.fixture
def executor():
    executor = Executor(workers=1, queue_limit=4000)
    yield executor
    executor.stop(PATIENCE)


def test_nobody_waits_and_the_only_worker_hangs_yet_the_ticket_expires(executor):
    gate = Gate()
    executor.submit(task(gate))
    assert gate.entered.acquire(timeout=PATIENCE)
    ticket = executor.submit(task(Note("a"), deadline=executor.clock() + 0.02))
    told = threading.Event()
    ticket.future.add_done_callback(lambda future: told.set())
    assert told.wait(PATIENCE)
    assert isinstance(ticket.future.exception(), DeadlineExceeded)
    assert executor.queue_depth == 0
    gate.opened.set()


def test_deadlines_in_any_order_are_met(executor):
    gate = Gate()
    executor.submit(task(gate))
    assert gate.entered.acquire(timeout=PATIENCE)
    now = executor.clock()
    tickets = [executor.submit(task(Note("a"), deadline=now + delay / 100)) for delay in (3, 1, 2, 5, 4)]
    until(lambda: all(ticket.settled for ticket in tickets))
    assert executor.clock() >= now + 0.05
    assert executor.counts().expired == 5
    gate.opened.set()


def test_settled_tickets_are_thrown_out_before_their_distant_deadline(clock):
    deadlines = Deadlines(clock)
    tickets = [Ticket(FAR, clock) for _ in range(3 * FEW)]
    for ticket in tickets:
        deadlines.watch(ticket)
        ticket.cancel()
    assert len(deadlines._due) <= FEW
    deadlines.stop()


def test_an_executor_is_sound_until_a_stage_hangs_and_again_when_it_ends(clock):
    executor, gate = Executor(1, 4, clock=clock), Gate()
    assert executor.sound
    ticket = executor.submit(task(gate))
    assert gate.entered.acquire(timeout=PATIENCE)
    assert executor.sound
    clock.now += WEDGED_S + 0.1
    assert not executor.sound
    gate.opened.set()
    ticket.result()
    until(lambda: executor.sound)
    executor.stop(PATIENCE)


def test_a_dead_worker_is_noticed():
    executor = Executor(1, 4)
    assert executor.stop(PATIENCE)
    assert not executor.sound


def test_the_age_of_the_queue_is_that_of_its_oldest(clock):
    executor, gate = Executor(1, 4, clock=clock), Gate()
    executor.submit(task(gate))
    assert gate.entered.acquire(timeout=PATIENCE)
    assert executor.queue_age == 0
    executor.submit(task(Note("a")))
    clock.now += 1.5
    executor.submit(task(Note("b")))
    assert executor.queue_age == 1.5
    gate.opened.set()
    executor.stop(PATIENCE)
