"""The open loop, on a clock of its own: a slow target neither slows the schedule nor hides."""

import asyncio
import socket

import numpy as np
import pytest

from loadtest.simulated import ScriptedTarget, VirtualLoop, plan_of, quick, sent
from shipshape.loadtest.budget import Budget, Verdict
from shipshape.loadtest.outcomes import Outcome, Reply
from shipshape.loadtest.precise import precise_loop
from shipshape.loadtest.sending import Sender
from shipshape.loadtest.summary import summarise

BUDGET = Budget(0.99, 0.05)


def stalls_for_a_second(now):
    """Whatever comes between 1 and 2 s is answered at 2 s."""
    return (2.0 - now if 1.0 <= now < 2.0 else 0.001), Reply(Outcome.OK)


def test_requests_leave_when_they_are_due():
    plan = plan_of()
    records = sent(plan, quick)
    assert records.sent == pytest.approx(plan.due, abs=1e-9)
    assert records.done == pytest.approx(plan.due + 0.001, abs=1e-9)


def test_a_stall_does_not_stop_the_schedule_and_shows_in_the_percentiles():
    plan = plan_of()
    records = sent(plan, stalls_for_a_second)
    assert records.sent == pytest.approx(plan.due, abs=1e-9)
    run = summarise(plan, records, BUDGET)
    # 100 of 300 requests wait for 0 to 1 s, evenly: a tenth of all waits for 0.7 s or more. A tool that waits for
    # each answer would have met the stall once, and called its p99 1 ms.
    assert run.latency.percentiles["p90"] == pytest.approx(700, abs=15)
    assert run.latency.max == pytest.approx(1000, abs=15)
    assert run.in_budget == pytest.approx(205, abs=2)
    assert run.verdict is Verdict.NOT_HELD


def test_a_tool_that_stands_still_says_so_and_counts_it_as_latency():
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        loop = runner.get_loop()
        loop.call_at(1.0, loop.freeze, 1.0)
        plan = plan_of()
        records = runner.run(Sender(ScriptedTarget(quick), plan).run(0.0))
    run = summarise(plan, records, BUDGET)
    assert run.verdict is Verdict.TOOL_TOO_SLOW
    assert run.lag.max == pytest.approx(1000, abs=15)
    assert run.latency.percentiles["p90"] == pytest.approx(700, abs=15)
    assert run.service.max == pytest.approx(1, abs=0.1)


def test_what_is_due_beyond_the_cap_is_not_sent_and_is_counted():
    plan = plan_of(most_under_way=5)
    records = sent(plan, lambda now: (100.0, Reply(Outcome.OK)))
    run = summarise(plan, records, BUDGET)
    assert run.outcomes["ok"] == 5
    assert run.outcomes["unsent"] == 295
    assert run.in_budget == 0


def test_the_warm_up_is_sent_but_not_counted():
    plan = plan_of(warmup_s=1.0, seconds=2.0)
    slow_first = sent(plan, lambda now: (0.5 if now < 0.9 else 0.001, Reply(Outcome.OK)))
    run = summarise(plan, slow_first, BUDGET)
    assert (run.warmup_requests, run.requests) == (100, 200)
    assert run.verdict is Verdict.HELD


def test_somebody_who_looks_on_is_told_of_each_ending():
    plan = plan_of()
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        sender = Sender(ScriptedTarget(quick), plan, watched=True)
        runner.run(sender.run(0.0))
    assert [ending.outcome for ending in sender.fresh] == [Outcome.OK] * 300
    assert [ending.seconds for ending in sender.fresh] == pytest.approx([0.001] * 300)


def test_parts_of_a_plan_are_the_plan():
    plan = plan_of()
    parts = [plan.part(index, 3) for index in range(3)]
    assert np.sort(np.concatenate([part.due for part in parts])) == pytest.approx(plan.due)


def test_the_precise_loop_wakes_for_timers_and_for_bytes():
    async def both():
        ours, theirs = socket.socketpair()
        ours.setblocking(False)
        with ours, theirs:
            loop = asyncio.get_running_loop()
            loop.call_later(0.002, theirs.send, b"late")
            before = loop.time()
            assert await loop.sock_recv(ours, 4) == b"late"
            return loop.time() - before

    with asyncio.Runner(loop_factory=precise_loop) as runner:
        assert runner.run(both()) >= 0.002
