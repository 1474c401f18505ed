import random
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import pytest

from shipshape.errors import Cancelled, DeadlineExceeded, NotReady, Overloaded, ShipshapeError
from shipshape.executor import Executor, Task

FAR = 1e9
PATIENCE = 10.0


class HandClock:
    """Time that passes only when the test says so."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@dataclass
class Item:
    seen: list = field(default_factory=list)


class Note:
    def __init__(self, name, action=lambda item: None):
        self.name = name
        self.action = action

    def run(self, work):
        work.seen.append(self.name)
        self.action(work)


class Gate(Note):
    """A stage that holds its worker until the test opens it."""

    def __init__(self, name="gate"):
        self.entered, self.opened = threading.Semaphore(0), threading.Event()
        super().__init__(name, self._hold)

    def _hold(self, work):
        self.entered.release()
        assert self.opened.wait(PATIENCE)


class Steps:
    """A rung of these stages."""

    def __init__(self, *stages, name="full"):
        self.name, self.stages = name, stages


def task(*stages, ladder=None, deadline=FAR, finish=lambda work, ended: (work, dict(ended.stage_ms)), **fields):
    return Task(ladder or [Steps(*stages)], Item(), finish, deadline, **fields)


@pytest.fixture
def clock():
    return HandClock()


@pytest.fixture
def executor(clock):
    executor = Executor(workers=1, queue_limit=3, clock=clock)
    yield executor
    executor.stop(PATIENCE)


@pytest.fixture
def gate(executor):
    """The only worker is held in this stage until the gate is opened."""
    gate = Gate()
    executor.submit(task(gate))
    assert gate.entered.acquire(timeout=PATIENCE)
    yield gate
    gate.opened.set()


def test_stages_run_in_order_and_are_timed(executor, clock):
    def tick(work):
        clock.now += 0.25

    item, stage_ms = executor.submit(task(Note("a", tick), Note("b"))).result()
    assert item.seen == ["a", "b"]
    assert stage_ms == {"a": 250.0, "b": 0.0}


def test_an_endless_deadline_can_be_waited_for(executor):
    assert executor.submit(task(Note("a"), deadline=float("inf"))).result()[0].seen == ["a"]


def test_full_queue_refuses_at_once(executor, gate):
    for _ in range(3):
        executor.submit(task(Note("a")))
    with pytest.raises(Overloaded, match="at most 0 more in the queue of 3, got 1"):
        executor.submit(task(Note("a")))
    assert executor.counts().refused == 1


def test_a_group_is_queued_whole_or_not_at_all(executor, gate):
    executor.submit(task(Note("a")))
    with pytest.raises(Overloaded):
        executor.submit_all([task(Note("a"))] * 3)
    assert executor.queue_depth == 1
    assert len(executor.submit_all([task(Note("a")), task(Note("a"))])) == 2


def test_expired_in_the_queue_is_never_computed(executor, gate, clock):
    late = task(Note("a"), deadline=5.0)
    ticket = executor.submit(late)
    clock.now = 5.0
    gate.opened.set()
    with pytest.raises(DeadlineExceeded):
        ticket.result()
    executor.stop(PATIENCE)
    assert late.work.seen == []


def test_deadline_is_checked_at_each_stage_boundary(executor, clock):
    def overrun(work):
        clock.now = 2.0

    late = task(Note("a", overrun), Note("b"), deadline=1.0)
    ticket = executor.submit(late)
    with pytest.raises(DeadlineExceeded):
        ticket.future.result(PATIENCE)
    assert late.work.seen == ["a"]


def test_an_answer_after_the_deadline_is_not_given(executor, clock):
    def overrun(work):
        clock.now = 2.0

    with pytest.raises(DeadlineExceeded):
        executor.submit(task(Note("last", overrun), deadline=1.0)).future.result(PATIENCE)


def test_the_waiter_gets_its_answer_at_the_deadline_though_a_stage_hangs(executor, gate, clock):
    ticket = executor.submit(task(Note("a"), deadline=1.0))
    clock.now = 1.0
    with pytest.raises(DeadlineExceeded):
        ticket.result()
    assert executor.queue_depth == 0, "its place in the queue is free again"


def test_cancelled_in_the_queue_frees_its_place(executor, gate):
    left = task(Note("a"))
    ticket = executor.submit(left)
    ticket.cancel()
    assert executor.queue_depth == 0
    with pytest.raises(Cancelled):
        ticket.result()
    gate.opened.set()
    executor.stop(PATIENCE)
    assert left.work.seen == []


def test_a_cancelled_future_counts_as_cancelled(executor, gate):
    ticket = executor.submit(task(Note("a")))
    assert ticket.future.cancel()
    assert executor.queue_depth == 0
    assert executor.counts().cancelled == 1


def test_cancelled_while_running_stops_at_the_boundary_and_keeps_its_worker_until_then(executor):
    gate = Gate()
    left = task(gate, Note("after"))
    ticket = executor.submit(left)
    assert gate.entered.acquire(timeout=PATIENCE)
    ticket.cancel()
    assert ticket.settled
    assert executor.running == 1
    gate.opened.set()
    executor.stop(PATIENCE)
    assert left.work.seen == ["gate"]
    assert executor.counts().cancelled == 1


@pytest.mark.parametrize("error", [ValueError("broken"), TimeoutError("inner")])
def test_an_error_in_a_stage_reaches_the_caller_and_spares_the_worker(executor, error):
    def fail(work):
        raise error

    with pytest.raises(type(error)) as caught:
        executor.submit(task(Note("bad", fail))).result()
    assert caught.value is error
    assert executor.submit(task(Note("good"))).result()[0].seen == ["good"]


def test_a_stage_that_wants_to_exit_only_fails(executor):
    with pytest.raises(RuntimeError, match=r"SystemExit\(3\)"):
        executor.submit(task(Note("bad", lambda item: sys.exit(3)))).result()
    assert executor.submit(task(Note("good"))).result()[0].seen == ["good"]


def test_an_error_in_finish_reaches_the_caller(executor):
    def finish(work, ended):
        raise KeyError("lost")

    with pytest.raises(KeyError):
        executor.submit(task(finish=finish)).result()


def test_stages_are_observed_for_every_outcome():
    seen = []
    executor = Executor(1, 4, on_stage=lambda name, seconds: seen.append(name))

    def fail(work):
        raise KeyError("planned")

    with pytest.raises(KeyError):
        executor.submit(task(Note("a"), Note("b", fail), Note("c"))).result()
    executor.stop(PATIENCE)
    assert seen == ["a", "b"]


def test_stop_drains_what_was_admitted_and_refuses_the_rest(executor, gate):
    waiting = executor.submit(task(Note("a")))
    with ThreadPoolExecutor(1) as pool:
        stopping = pool.submit(executor.stop, PATIENCE)
        refused_by_now = _until_refused(executor)
        gate.opened.set()
        assert stopping.result() is True
    assert refused_by_now
    assert waiting.result()[0].seen == ["a"]


def _until_refused(executor):
    for _ in range(1_000_000):
        try:
            executor.submit(task(deadline=-1.0)).cancel()
        except NotReady:
            return True
        except Overloaded:
            continue
    return False


def test_stop_gives_up_after_its_time_and_tells_the_waiters():
    executor, gate = Executor(1, 4), Gate()
    executor.submit(task(gate))
    assert gate.entered.acquire(timeout=PATIENCE)
    waiting = executor.submit(task(Note("a")))
    assert executor.stop(0.0) is False
    with pytest.raises(NotReady):
        waiting.result()
    gate.opened.set()


def test_thousands_of_mixed_tasks_add_up():
    executor = Executor(4, 64)
    random_source = random.Random(7)

    def fail(work):
        raise ValueError("planned")

    def one(kind):
        stages = [Note("a"), Note("b", fail) if kind == "fail" else Note("b")]
        try:
            ticket = executor.submit(task(*stages, deadline=-1.0 if kind == "late" else FAR))
            if kind == "leave":
                ticket.cancel()
            ticket.result()
        except (ShipshapeError, ValueError) as error:
            return type(error).__name__
        return "ok"

    kinds = [random_source.choice(["ok", "fail", "late", "leave"]) for _ in range(4000)]
    with ThreadPoolExecutor(16) as pool:
        outcomes = list(pool.map(one, kinds))
    assert executor.stop(PATIENCE)
    counts = executor.counts()
    assert counts.offered == len(kinds)
    assert counts.pending == 0
    assert executor.queue_depth == executor.running == 0
    assert counts.failed == outcomes.count("ValueError")
    assert counts.expired == outcomes.count("DeadlineExceeded") == kinds.count("late")
    assert counts.completed >= kinds.count("ok") - counts.refused
    assert counts.refused == outcomes.count("Overloaded")
