import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.test_executor import PATIENCE, Gate, Note, task
from shipshape.errors import Overloaded
from shipshape.executor import Executor, Lane
from shipshape.executor.lanes import Queues, places


@pytest.fixture
def order():
    return []


@pytest.fixture
def executor():
    executor = Executor(workers=1, queue_limit=8)
    yield executor
    executor.stop(PATIENCE)


def noted(order, name, **fields):
    return task(Note(name, lambda item: order.append(name)), **fields)


def test_the_most_urgent_lane_goes_first_whatever_came_first(executor, order):
    gate = Gate()
    executor.submit(task(gate, lane=Lane.COLLISION))
    assert gate.entered.acquire(timeout=PATIENCE)
    tickets = [executor.submit(noted(order, lane, lane=lane)) for lane in reversed(Lane)]
    gate.opened.set()
    for ticket in tickets:
        ticket.result()
    assert order == list(Lane)


def test_work_gives_way_between_two_stages_and_goes_on_where_it_was(executor, order):
    gate = Gate()
    slow = executor.submit(task(gate, Note("b", lambda item: order.append("batch goes on")), lane=Lane.BATCH))
    assert gate.entered.acquire(timeout=PATIENCE)
    urgent = executor.submit(noted(order, "collision", lane=Lane.COLLISION))
    gate.opened.set()
    urgent.result()
    item, stage_ms = slow.result()
    assert order == ["collision", "batch goes on"]
    assert item.seen == ["gate", "b"], "no stage ran twice"
    assert list(stage_ms) == ["gate", "b"]


def test_work_that_gave_way_goes_before_the_others_of_its_lane(executor, order):
    gate = Gate()
    first = executor.submit(task(gate, Note("b", lambda item: order.append("first")), lane=Lane.BATCH))
    assert gate.entered.acquire(timeout=PATIENCE)
    second = executor.submit(noted(order, "second", lane=Lane.BATCH))
    executor.submit(noted(order, "collision", lane=Lane.COLLISION))
    gate.opened.set()
    first.result()
    second.result()
    assert order == ["collision", "first", "second"]


def test_work_that_gave_way_can_still_be_cancelled(executor):
    first, second = Gate("first"), Gate("second")
    ticket = executor.submit(task(first, Note("never"), lane=Lane.BATCH))
    assert first.entered.acquire(timeout=PATIENCE)
    executor.submit(task(second, lane=Lane.COLLISION))
    first.opened.set()
    assert second.entered.acquire(timeout=PATIENCE)
    assert executor.queue_depth == 1
    ticket.cancel()
    assert executor.queue_depth == 0
    second.opened.set()


def test_a_flood_of_batch_work_leaves_room_for_the_others(executor):
    gate = Gate()
    executor.submit(task(gate))
    assert gate.entered.acquire(timeout=PATIENCE)
    for lane, room in [(Lane.BATCH, 4), (Lane.TRACKING, 3), (Lane.COLLISION, 1)]:
        for _ in range(room):
            executor.submit(task(Note("a"), lane=lane))
        with pytest.raises(Overloaded, match="at most 0 more in the queue of 8, got 1"):
            executor.submit(task(Note("a"), lane=lane))
    gate.opened.set()


@given(limit=st.integers(1, 10_000))
def test_every_lane_has_a_place_and_the_first_has_all(limit):
    assert places(Lane.COLLISION, limit) == limit
    assert 1 <= places(Lane.BATCH, limit) <= places(Lane.TRACKING, limit) <= limit


LANES = st.sampled_from(list(Lane))


@given(st.lists(st.tuples(LANES, st.floats(0, 10)), max_size=30), st.data())
def test_seconds_are_those_of_what_waits(entries, data):
    queues = Queues()
    for number, (lane, seconds) in enumerate(entries):
        queues.append(lane, number, seconds)
    waiting = dict(enumerate(entries))
    for _ in range(data.draw(st.integers(0, len(entries)))):
        if data.draw(st.booleans()):
            lane, number = queues.take()
            assert number == min(n for n, (other, _) in waiting.items() if other is lane)
        else:
            number = data.draw(st.sampled_from(sorted(waiting)))
            assert queues.remove(waiting[number][0], number)
        del waiting[number]
    assert len(queues) == len(waiting)
    for place, lane in enumerate(Lane):
        expected = sum(s for other, s in waiting.values() if list(Lane).index(other) <= place)
        assert queues.seconds(lane) == pytest.approx(expected, abs=1e-9)
        assert queues.before(lane) == any(list(Lane).index(other) < place for other, _ in waiting.values())


def test_thousands_in_all_lanes_add_up():
    executor = Executor(workers=3, queue_limit=4000)
    start = threading.Barrier(8)

    def flood(lane):
        start.wait()
        return [executor.submit(task(Note("a"), Note("b"), Note("c"), lane=lane)) for _ in range(200)]

    with ThreadPoolExecutor(8) as pool:
        tickets = [ticket for some in pool.map(flood, [*Lane, *Lane, *Lane][:8]) for ticket in some]
    assert all(ticket.result()[0].seen == ["a", "b", "c"] for ticket in tickets)
    assert executor.stop(PATIENCE)
    assert executor.counts().completed == len(tickets)
    assert executor.wait(Lane.BATCH) == 0
