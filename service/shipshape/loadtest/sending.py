"""The open loop: each request leaves when it is due, however slow the answers to the others are."""

import asyncio
from typing import NamedTuple

from shipshape.loadtest.plan import Plan
from shipshape.loadtest.records import Records, unsent
from shipshape.loadtest.targets.target import Payload, Target


class Ending(NamedTuple):
    """A request that has just ended: how, and how long after it was due, seconds."""

    outcome: int
    seconds: float


class Sender:
    """Sends a plan to a target, once.

    Args:
        target: Open already.
        plan: What to send.
        watched: Keep `fresh` endings for somebody who looks on.
    """

    def __init__(self, target: Target, plan: Plan, *, watched: bool = False) -> None:
        self.fresh: list[Ending] = []
        self._target = target
        self._plan = plan
        self._watched = watched
        self._payloads: list[Payload] = [target.encode(request) for request in plan.requests]
        self._records = unsent(plan)
        self._under_way: set[asyncio.Task[None]] = set()

    async def run(self, start: float) -> Records:
        """Send all; the records, once the last request has ended.

        Args:
            start: On the event loop's clock, the moment from which requests count.
        """
        loop = asyncio.get_running_loop()
        for index, due in enumerate(self._plan.due.tolist()):
            # Also when it is late already: requests that were begun must get their turn to leave.
            await asyncio.sleep(max(0.0, start + due - loop.time()))
            if len(self._under_way) < self._plan.most_under_way:
                task = loop.create_task(self._send(index, start))
                self._under_way.add(task)
                task.add_done_callback(self._under_way.discard)
        await asyncio.gather(*self._under_way)
        return self._records

    async def _send(self, index: int, start: float) -> None:
        loop = asyncio.get_running_loop()
        payload = self._payloads[self._plan.request[index]]
        sent = loop.time() - start
        reply = await self._target.send(payload, self._plan.deadline_s)
        done = loop.time() - start
        self._records.close(index, sent, done, reply)
        if self._watched:
            self.fresh.append(Ending(reply.outcome, done - float(self._plan.due[index])))
