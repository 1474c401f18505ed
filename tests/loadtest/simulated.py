"""An event loop on a clock of its own, targets that answer when told to, and plans and records to measure."""

import asyncio
import selectors
from dataclasses import replace

import numpy as np

from shipshape.loadtest.arrivals import constant, equal
from shipshape.loadtest.mixture import Mixture
from shipshape.loadtest.outcomes import Outcome, Reply
from shipshape.loadtest.plan import Terms, make_plan
from shipshape.loadtest.records import unsent
from shipshape.loadtest.sending import Sender
from shipshape.loadtest.targets.target import TargetInfo

CLUSTER = np.arange(30, dtype=np.float32).reshape(10, 3)
INFO = TargetInfo("1.2.3", "fake", "ab" * 32, 50.0)


class VirtualSelector(selectors.DefaultSelector):
    """Waits for nothing: the time passes at once."""

    now = 0.0

    def select(self, timeout=None):
        events = super().select(0)
        if not events and timeout:
            self.now += timeout
        return events


class VirtualLoop(asyncio.SelectorEventLoop):
    def __init__(self):
        self.selector = VirtualSelector()
        super().__init__(self.selector)

    def time(self):
        return self.selector.now

    def freeze(self, seconds):
        """The whole process stands still for so long."""
        self.selector.now += seconds


class ScriptedTarget:
    """Answers a request sent at `now` as `script(now)` says: after so many seconds, with this reply."""

    def __init__(self, script):
        self.script = script

    def encode(self, request):
        return request

    async def send(self, payload, deadline_s):
        delay, reply = self.script(asyncio.get_running_loop().time())
        await asyncio.sleep(delay)
        return reply


def quick(now):
    return 0.001, Reply(Outcome.OK)


def plan_of(rate=100.0, seconds=3.0, *, warmup_s=0.0, most_under_way=10_000, mixture=None, contacts=1):
    terms = Terms(seconds, warmup_s, deadline_s=60.0, most_under_way=most_under_way)
    mixture = mixture or Mixture([(CLUSTER, 1.0)], {"": 1.0})
    draw = lambda length, rng: equal(constant(rate, length), contacts)  # noqa: E731
    return make_plan(draw, mixture, terms, np.random.default_rng(0))


def sent(plan, script, **options):
    """The records of a plan sent to a scripted target, on a virtual clock that starts with the warm-up."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        sender = Sender(ScriptedTarget(script), plan, **options)
        return runner.run(sender.run(-float(min(plan.due[0], 0.0))))


def recorded(plan, latency_s, outcomes=None, lag_s=0.0):
    """Records of a plan of which each request took so long, counted from when it was due."""
    records = unsent(plan)
    records.sent = plan.due + lag_s
    records.done = plan.due + latency_s
    records.outcome[:] = Outcome.OK if outcomes is None else outcomes
    return records


class QueueProcesses:
    """In the place of `Processes`: one worker that takes `work_s` for each request, and a queue without end."""

    info = INFO

    def __init__(self, work_s, lag_s=0.0):
        self.work_s, self.lag_s, self.plans = work_s, lag_s, []

    def __call__(self, address, count):
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def run(self, plan, watch=None):
        self.plans.append(plan)
        done, free = np.empty(len(plan.due)), -np.inf
        for index, due in enumerate(plan.due):
            free = done[index] = max(free, due) + self.work_s
        return replace(recorded(plan, done - plan.due, lag_s=self.lag_s))
