"""Entries at hand take turns, a stage each: on a hand clock, with a mailbox that has all at once."""

import pytest

from executor.test_executor import FAR, PATIENCE, Gate, HandClock, Note, Steps, task
from shipshape.errors import Cancelled, DeadlineExceeded
from shipshape.executor import Executor, Lane
from shipshape.executor.admission import AHEAD_S, QUEUE_HEADROOM, STANDING_S, behind
from shipshape.executor.costs import Costs
from shipshape.executor.entry import Entry
from shipshape.executor.worker import Worker, rehearse


class Letters:
    """A mailbox with these deliveries, one a look, the first of which is waited for."""

    LOOK_S = 0.0

    def __init__(self, *deliveries):
        self.deliveries = list(deliveries)
        self.told = []

    def read(self, *, wait):
        if self.deliveries:
            return self.deliveries.pop(0)
        return None if wait else ()

    def others_wait(self):
        return False

    def ended(self, entries):
        self.told.append(list(entries))


class Yard:
    """Entries whose two stages take a second each, and one worker for them."""

    def __init__(self):
        self.clock, self.costs, self.ran = HandClock(), Costs(), []
        self.first, self.second = Note("first", self._tick), Note("second", self._tick)
        self.full = Steps(self.first, self.second)
        for _ in range(4):
            rehearse(task(ladder=[self.full]), self.costs, self.clock)

    def entry(self, name, *, lane=Lane.TRACKING, deadline=FAR, ladder=None):
        entry = Entry(
            task(ladder=ladder or [self.full], deadline=deadline, lane=lane, finish=self._finish), self.clock
        )
        entry.task.work.name = name
        entry.move_to(0, self.costs)
        return entry

    def work(self, *deliveries):
        mailbox = Letters(*deliveries)
        Worker(mailbox, self.costs, self.clock, lambda name, seconds: self.ran.append(name)).work()
        return mailbox.told

    def _tick(self, work):
        self.clock.now += 1.0

    def _finish(self, work, ended):
        return f"{work.name}: {', '.join(work.seen)}"


@pytest.fixture
def yard():
    return Yard()


def answer(entry):
    return entry.ticket.future.result(0)


def test_entries_at_hand_take_turns_and_are_told_of_together(yard):
    group = [yard.entry(name) for name in "abc"]
    assert yard.work(group) == [group]
    assert yard.ran == ["first"] * 3 + ["second"] * 3
    assert [answer(entry) for entry in group] == [f"{name}: first, second" for name in "abc"]


def test_each_is_charged_with_its_own_time(yard):
    group = [yard.entry(name) for name in "ab"]
    yard.work(group)
    assert [entry.busy for entry in group] == [2.0, 2.0]
    assert [entry.stage_ms for entry in group] == [{"first": 1e3, "second": 1e3}] * 2


def test_what_comes_meanwhile_waits_for_the_next_group(yard):
    first, later = yard.entry("a"), yard.entry("b")
    assert yard.work([first], [later]) == [[first], [later]]
    assert yard.ran == ["first", "second"] * 2


def test_nobody_is_made_late_by_turns(yard):
    urgent, other = yard.entry("a", deadline=4.0 * QUEUE_HEADROOM - 0.1 + 8.0), yard.entry("b")
    assert yard.clock.now == 8.0, "after the rehearsals"
    assert yard.work([urgent, other]) == [[urgent], [other]]
    assert yard.ran == ["first", "second"] * 2


def test_with_time_enough_they_take_turns(yard):
    group = [yard.entry("a", deadline=4.0 * QUEUE_HEADROOM + 8.0), yard.entry("b")]
    assert yard.work(group) == [group]


def test_only_those_of_one_lane_take_turns(yard):
    collision, batch = yard.entry("a", lane=Lane.COLLISION), yard.entry("b", lane=Lane.BATCH)
    assert yard.work([batch, collision]) == [[collision], [batch]]
    assert yard.ran == ["first", "second"] * 2


def test_a_group_gives_way_and_goes_on_where_it_was(yard):
    group, urgent = [yard.entry(name) for name in "ab"], yard.entry("c", lane=Lane.COLLISION)
    assert yard.work(group, [urgent]) == [[urgent], group]
    assert [answer(entry) for entry in group] == ["a: first, second", "b: first, second"], "no stage ran twice"


def test_one_that_fails_ends_alone_and_is_told_of_before_the_others_end(yard):
    def burst(work):
        raise ValueError("planned")

    bad, good = yard.entry("a", ladder=[Steps(Note("bad", burst))]), yard.entry("b")
    assert yard.work([bad, good]) == [[bad], [good]]
    with pytest.raises(ValueError, match="planned"):
        answer(bad)
    assert answer(good) == "b: first, second"


def test_one_that_nobody_wants_any_more_ends_alone(yard):
    left, good = yard.entry("a"), yard.entry("b")
    left.ticket.cancel()
    yard.work([left, good])
    with pytest.raises(Cancelled):
        answer(left)
    assert answer(good) == "b: first, second"
    assert yard.ran == ["first", "second"]


def test_one_that_will_be_late_gives_its_turns_to_the_others(yard):
    def stall(work):
        yard.clock.now += 10.0

    slow, late = yard.entry("a", ladder=[Steps(Note("stall", stall))]), yard.entry("b", deadline=19.5)
    yard.work([slow, late])
    with pytest.raises(DeadlineExceeded):
        answer(late)
    assert yard.ran == ["stall"]


@pytest.mark.parametrize("seconds", [0.0, AHEAD_S / 2, AHEAD_S, 10 * AHEAD_S])
def test_a_queue_that_stands_is_counted_longer_by_the_turns_of_those_to_come(seconds):
    assert behind(seconds, busy_s=STANDING_S) == seconds
    assert behind(seconds, busy_s=2 * STANDING_S) == seconds + min(seconds, AHEAD_S)


def test_a_queue_stands_when_no_worker_rested_for_long():
    clock, gate = HandClock(), Gate()
    executor = Executor(workers=1, queue_limit=8, clock=clock)
    executor.learn([(gate, 1.0) for _ in range(8)], 0.0)
    clock.now = 100.0  # the worker has long had nothing to do, and has until now
    executor.submit(task(gate))
    assert executor.wait(Lane.TRACKING) == 1.0
    clock.now += 2 * STANDING_S
    assert executor.wait(Lane.TRACKING) == 1.0 + AHEAD_S
    gate.opened.set()
    assert executor.stop(PATIENCE)
