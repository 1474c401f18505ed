"""Admission by predicted completion, and the rungs that work is put on and changes to."""

import pytest

from executor.test_executor import FAR, PATIENCE, Gate, HandClock, Note, Steps, task
from shipshape.errors import DeadlineExceeded, Overloaded
from shipshape.executor import Executor, Lane
from shipshape.executor.admission import HEADROOM


class Ticking:
    """Stages that take a known time on the hand clock, on three rungs with a common beginning."""

    def __init__(self, clock):
        def tick(seconds):
            def action(item):
                clock.now += seconds

            return action

        self.look, self.restore, self.name = Note("look", tick(1)), Note("restore", tick(4)), Note("name", tick(1))
        self.ladder = [
            Steps(self.look, self.restore, self.name, name="full"),
            Steps(self.look, self.name, name="middle"),
            Steps(self.look, name="least"),
        ]

    def task(self, *before, rungs=3, **fields):
        ladder = [Steps(*before, *rung.stages, name=rung.name) if before else rung for rung in self.ladder[:rungs]]
        return task(ladder=ladder, finish=lambda work, ended: (work.seen, ended), **fields)


@pytest.fixture
def clock():
    return HandClock()


@pytest.fixture
def executor(clock):
    executor = Executor(workers=1, queue_limit=100, clock=clock)
    yield executor
    executor.stop(PATIENCE)


@pytest.fixture
def ticking(clock, executor):
    """All costs are known."""
    ticking = Ticking(clock)
    for _ in range(3):
        executor.submit(ticking.task()).result()
    return ticking


@pytest.fixture
def busy(executor, clock, ticking):
    """A worker that is held, and before it six seconds of work."""
    gate = Gate()
    executor.submit(task(gate))
    assert gate.entered.acquire(timeout=PATIENCE)
    executor.submit(ticking.task(rungs=1))
    yield gate
    gate.opened.set()


def test_with_time_enough_the_answer_is_full(executor, ticking, clock):
    seen, ended = executor.submit(ticking.task(deadline=clock.now + 6 * HEADROOM)).result()
    assert seen == ["look", "restore", "name"]
    assert (ended.rung, ended.why) == ("full", "")
    assert executor.counts().degraded == 0


@pytest.mark.parametrize(("slack", "rung", "stages"), [(5, "middle", ["look", "name"]), (1.5, "least", ["look"])])
def test_with_less_time_it_is_the_dearest_that_fits(executor, ticking, clock, slack, rung, stages):
    seen, ended = executor.submit(ticking.task(deadline=clock.now + slack)).result()
    assert (seen, ended.rung) == (stages, rung)
    assert ended.why == f"the full answer was expected to take 6000.0 ms, with {slack * 1e3:.1f} ms left"
    assert executor.counts().degraded == 1


def test_a_caller_may_forbid_it_and_an_idle_worker_tries(executor, ticking, clock):
    ticket = executor.submit(ticking.task(rungs=1, deadline=clock.now + 5.9))
    with pytest.raises(DeadlineExceeded):
        ticket.future.result(PATIENCE)


def test_what_cannot_end_in_time_behind_others_is_refused_at_once_and_told_when_to_come(
    executor, ticking, clock, busy
):
    with pytest.raises(Overloaded, match="expected 16500 ms for an answer behind all that waits, got 10000") as no:
        executor.submit(ticking.task(rungs=1, deadline=clock.now + 10))
    assert no.value.retry_after_s == pytest.approx(6.5)
    assert executor.counts().refused == 1


def test_the_ladder_is_tried_before_refusing(executor, ticking, clock, busy):
    ticket = executor.submit(ticking.task(deadline=clock.now + 12))
    busy.opened.set()
    assert ticket.result()[1].rung == "middle"


def test_what_cannot_end_in_time_even_alone_is_told_so(executor, ticking, clock, busy):
    with pytest.raises(DeadlineExceeded, match=r"expected at least 1250\.0 ms for an answer, got 500\.0 ms"):
        executor.submit(ticking.task(deadline=clock.now + 0.5))


def test_urgent_work_does_not_count_what_it_overtakes(executor, ticking, clock, busy):
    assert executor.wait(Lane.COLLISION) == 0
    assert executor.wait(Lane.TRACKING) == executor.wait(Lane.BATCH) == pytest.approx(6)
    executor.submit(ticking.task(rungs=1, deadline=clock.now + 8, lane=Lane.COLLISION))


def test_a_scan_needs_time_for_all_its_contacts(executor, ticking, clock, busy):
    scan = [ticking.task(rungs=1, deadline=clock.now + 20) for _ in range(2)]
    with pytest.raises(Overloaded):
        executor.submit_all(scan)
    executor.submit_all([ticking.task(deadline=clock.now + 20) for _ in range(2)])


def test_work_under_way_changes_to_the_rung_that_still_fits(executor, ticking, clock):
    def stall(item):
        clock.now += 10

    tasks = ticking.task(Note("stall", stall), deadline=clock.now + 14)
    seen, ended = executor.submit(tasks).result()
    assert seen == ["stall", "look", "name"]
    assert ended.rung == "middle"
    assert "expected to take 6000.0 ms, with 4000.0 ms left" in ended.why


def test_a_rung_that_begins_otherwise_cannot_be_changed_to(executor, clock):
    def stall(item):
        clock.now += 10

    def slow(item):
        clock.now += 5

    first, rest = Note("first"), Note("rest", slow)
    ladder = [Steps(first, rest), Steps(Note("other"), name="other")]
    for one in ladder:
        executor.submit(task(ladder=[one])).result()
    first.action = stall
    ticket = executor.submit(task(ladder=ladder, deadline=clock.now + 14))
    with pytest.raises(DeadlineExceeded):
        ticket.future.result(PATIENCE)


def test_what_will_be_late_gives_its_worker_to_others(executor, ticking, clock):
    gate = Gate()

    def stall(item):
        assert gate.entered.release() is None
        assert gate.opened.wait(PATIENCE)
        clock.now += 10

    late = executor.submit(ticking.task(Note("stall", stall), rungs=1, deadline=clock.now + 13))
    assert gate.entered.acquire(timeout=PATIENCE)
    other = executor.submit(ticking.task(deadline=FAR))
    gate.opened.set()
    with pytest.raises(DeadlineExceeded):
        late.future.result(PATIENCE)
    assert clock.now < 13 + 100
    assert other.result()[1].rung == "full"


def test_a_cost_that_was_once_dear_is_learned_again(executor, clock):
    stage = Note("a", lambda item: setattr(clock, "now", clock.now + 100))
    rung = Steps(stage)
    executor.submit(task(ladder=[rung])).result()
    stage.action = lambda item: setattr(clock, "now", clock.now + 0.1)
    assert executor.submit(task(ladder=[rung], deadline=clock.now + 1)).future.result(PATIENCE)


def test_what_is_expected_can_be_asked(executor, ticking):
    assert executor.promise(ticking.ladder[0], 0, Lane.BATCH) == pytest.approx(6 * HEADROOM)
    assert executor.promise(ticking.ladder[2], 0, Lane.BATCH) == pytest.approx(HEADROOM)
    assert executor.wait(Lane.BATCH) == 0
