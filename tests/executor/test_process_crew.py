"""Workers in processes: the same promises as in threads, and what happens when one of them dies."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest

from executor.test_executor import PATIENCE
from serving.fakes import until
from shipshape.errors import Cancelled, DeadlineExceeded, NotReady, Overloaded, Unprocessable
from shipshape.executor import Executor, Lane, ProcessCrew, Task, process_crew

TOYS = "executor.toys:prepare"
START_PATIENCE = 60.0


class Seen:
    """A rung as the service knows it."""

    def __init__(self, name):
        self.name, self.stages = name, ()


@pytest.fixture(autouse=True)
def _toys_can_be_imported(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]))


@pytest.fixture
def stages():
    return []


@pytest.fixture
def executor(stages):
    executor = Executor(2, 16, on_stage=lambda name, seconds: stages.append(name))
    yield executor
    executor.stop(PATIENCE)


@pytest.fixture
def crew(executor):
    return started(executor)


def started(executor, *arguments):
    crew = ProcessCrew(TOYS, *arguments)
    crew.loaded()
    crew.prepared(lambda: False)
    crew.start(executor, executor.workers)
    executor.join(crew)
    until(lambda: executor.sound)
    return crew


LADDER = [Seen("full"), Seen("less")]


def task(crew, *, deadline=None, lane=Lane.TRACKING, ladder=LADDER, **order):
    deadline = time.monotonic() + START_PATIENCE if deadline is None else deadline
    return Task(ladder, {"lane": str(lane), **order}, None, deadline, lane, crew=crew)


def processes(crew):
    return sorted(hand.process_id for hand in crew.hands if hand.alive)


def test_the_answer_comes_back_and_its_stages_are_observed(executor, crew, stages):
    answer = executor.submit(task(crew)).result()
    assert (answer["seen"], answer["rung"]) == (["first", "second"], "full")
    assert answer["process"] in processes(crew)
    assert answer["process"] != os.getpid()
    until(lambda: stages == ["first", "second"])


def test_all_workers_work(executor, crew):
    tickets = executor.submit_all([task(crew, first="slow") for _ in range(4)])
    assert {ticket.result()["process"] for ticket in tickets} == set(processes(crew))
    until(lambda: executor.running == 0)
    assert executor.counts().completed == 4


def test_an_error_comes_back_as_itself_or_with_its_traceback(executor, crew):
    with pytest.raises(Unprocessable, match="expected a toy, got a doll"):
        executor.submit(task(crew, refuse=True)).result()
    with pytest.raises(RuntimeError, match=r"(?s)toys.py.*ValueError: planned in second"):
        executor.submit(task(crew, second="raise")).result()
    with pytest.raises(RuntimeError, match=r"(?i)pickle"):
        executor.submit(task(crew, first="unspeakable")).result()
    assert executor.submit(task(crew)).result()["rung"] == "full"


def test_more_than_a_socket_holds_goes_through(executor, crew):
    load = os.urandom(12 * 2**20)
    tickets = executor.submit_all([task(crew, load=load) for _ in range(6)])
    assert [ticket.result()["size"] for ticket in tickets] == [len(load)] * 6


def test_a_worker_that_dies_is_replaced_and_the_rest_untouched(executor, crew):
    before = processes(crew)
    others = executor.submit_all([task(crew, first="slow") for _ in range(2)])
    until(lambda: executor.running == 2)
    victim, bystander = crew.hands
    os.kill(victim.process_id, signal.SIGKILL)
    ends = [ticket.future.exception(PATIENCE) for ticket in others]
    assert sorted(type(end) for end in ends if end is not None) == [NotReady]
    assert "expected an answer, got a worker that ended before it: ask again" in str(next(filter(None, ends)))
    until(lambda: executor.sound and victim not in crew.hands)
    assert bystander.process_id in processes(crew)
    assert len(set(before) & set(processes(crew))) == 1
    assert executor.submit(task(crew)).result()["rung"] == "full"
    assert executor.counts().pending == 0


def test_a_contact_that_kills_its_worker_kills_nothing_else(executor, crew):
    for _ in range(2):
        with pytest.raises(NotReady):
            executor.submit(task(crew, second="die")).result()
    assert executor.submit(task(crew)).result()["rung"] == "full"
    until(lambda: executor.sound)
    assert executor.counts().failed == 2


def test_a_worker_that_hangs_is_ended(executor, crew, monkeypatch):
    monkeypatch.setattr(process_crew, "ENDED_S", 0.2)
    ticket = executor.submit(task(crew, first="hang"))
    with pytest.raises(NotReady):
        ticket.future.result(PATIENCE)
    assert executor.submit(task(crew)).result()["rung"] == "full"


def test_the_process_that_forks_may_die_as_well(executor, crew):
    server = crew._server._process.pid
    os.kill(server, signal.SIGKILL)
    assert executor.submit(task(crew)).result()["rung"] == "full", "the workers go on"
    until(lambda: crew._server._process.pid != server)
    killed = processes(crew)[0]
    os.kill(killed, signal.SIGKILL)
    until(lambda: killed not in processes(crew) and executor.sound)
    assert executor.submit(task(crew)).result()["rung"] == "full"


def test_without_anybody_to_fork_it_is_not_worth_keeping_though_its_workers_go_on(executor, tmp_path):
    crew = started(executor, f"once:{tmp_path / 'prepared'}")
    assert executor.alive
    os.kill(crew._server._process.pid, signal.SIGKILL)
    until(lambda: not executor.alive)
    assert executor.submit(task(crew)).result()["rung"] == "full"


def test_a_caller_that_leaves_ends_the_work_at_the_next_stage(executor, crew, stages, tmp_path):
    ticket = executor.submit(task(crew, first="slow", touch=str(tmp_path / "begun")))
    until((tmp_path / "begun").exists)
    ticket.cancel()
    with pytest.raises(Cancelled):
        ticket.result()
    assert executor.running == 1, "its worker is not free yet"
    until(lambda: executor.running == 0)
    assert stages == ["first"]
    assert executor.counts().cancelled == 1


def test_the_deadline_holds_in_the_worker_too(executor, crew, stages):
    ticket = executor.submit(task(crew, first="slow", deadline=time.monotonic() + 0.05))
    with pytest.raises(DeadlineExceeded):
        ticket.future.result(PATIENCE)
    until(lambda: executor.running == 0)
    assert stages in ([], ["first"]), "not the second; not even the first when it came too late to the worker"


def test_urgent_work_overtakes_between_two_stages(executor, crew):
    batch = executor.submit_all([task(crew, first="slow", lane=Lane.BATCH) for _ in range(4)])
    until(lambda: executor.running == 2)
    ended = []
    for ticket in batch:
        ticket.future.add_done_callback(lambda _: ended.append("batch"))
    urgent = executor.submit(task(crew, lane=Lane.COLLISION))
    urgent.future.add_done_callback(lambda _: ended.append("urgent"))
    # The other worker may be quicker with its own; the one that turned to the urgent task had not reached the end.
    until(lambda: len(ended) == 5)
    assert ended.index("urgent") <= 1, ended
    assert all(ticket.result()["seen"] == ["first", "second"] for ticket in batch), "no stage ran twice"


def test_what_workers_hold_ahead_counts_in_the_early_look(executor, crew):
    executor.learn([(rung, 0.02) for rung in LADDER for _ in range(8)], 0.0)
    executor.check(Lane.TRACKING, time.monotonic() + 0.01)  # nobody goes before it
    held = executor.submit_all([task(crew, first="slow") for _ in range(4)])
    assert not executor._queues, "all four were given to workers"
    with pytest.raises(Overloaded):
        executor.check(Lane.TRACKING, time.monotonic() + 0.01)
    executor.check(Lane.TRACKING, time.monotonic() + START_PATIENCE)
    for ticket in held:
        ticket.cancel()


def test_a_full_queue_refuses(executor, crew):
    held = executor.submit_all([task(crew, first="slow", lane=Lane.COLLISION) for _ in range(16)])
    with pytest.raises(Overloaded):
        executor.submit_all([task(crew, lane=Lane.COLLISION) for _ in range(10)])
    for ticket in held:
        ticket.cancel()


def test_what_was_timed_is_what_admission_knows(executor, crew):
    rung = Seen("full")
    for _ in range(6):
        executor.submit(task(crew, ladder=[rung], first="slow")).result()
    until(lambda: executor.running == 0)
    assert executor.promise(rung, 0, Lane.TRACKING) >= 0.3


def test_a_preparation_that_fails_says_why():
    for what, error in (("refuse", Unprocessable), ("die", NotReady)):
        crew = ProcessCrew(TOYS, what)
        with pytest.raises(error):
            crew.loaded()
        crew.close()


def test_a_preparation_can_be_given_up():
    crew, stop = ProcessCrew(TOYS, "slow"), threading.Event()
    crew.loaded()
    threading.Timer(0.2, stop.set).start()
    with pytest.raises(Cancelled):
        crew.prepared(stop.is_set)
    crew.close()


def test_nothing_is_left_when_the_executor_stops():
    executor = Executor(2, 16)
    crew = started(executor)
    children = [psutil.Process(number) for number in (crew._server._process.pid, *processes(crew))]
    assert executor.stop(PATIENCE)
    assert psutil.wait_procs(children, PATIENCE)[1] == []
    assert not crew._thread.is_alive()


def test_stop_gives_up_what_hangs():
    executor = Executor(1, 16)
    ticket = executor.submit(task(started(executor), first="hang"))
    until(lambda: executor.running == 1)
    assert executor.stop(0.1) is False
    with pytest.raises(NotReady):
        ticket.future.result(PATIENCE)


OWNER = """
import time
from executor.test_process_crew import processes, started
from shipshape.executor import Executor
crew = started(Executor(1, 16))
print(crew._server._process.pid, *processes(crew), flush=True)
time.sleep(3600)
"""


def test_the_workers_end_with_a_service_that_is_killed():
    owner = subprocess.Popen([sys.executable, "-c", OWNER], stdout=subprocess.PIPE, text=True)
    children = [psutil.Process(int(number)) for number in owner.stdout.readline().split()]
    assert len(children) == 2
    owner.kill()
    owner.wait()
    owner.stdout.close()
    assert psutil.wait_procs(children, PATIENCE)[1] == []


def test_a_crew_that_was_left_computes_and_is_no_matter_of_the_callers(executor, crew):
    executor.leave(crew)
    assert executor.submit(task(crew)).result()["seen"] == ["first", "second"]
    hung = executor.submit(task(crew, first="slow"))
    assert executor.running == executor.queue_depth == executor.load == 0
    hung.result()
    executor.submit(task(crew, first="die")).future.exception(PATIENCE)
    assert executor.sound
    until(lambda: crew.whole)
    assert executor.submit(task(crew)).result()["seen"] == ["first", "second"]
    executor.join(crew)
    assert executor.sound
