"""Processes that do nothing but send, so that neither a progress line nor a report delays a request."""

import asyncio
import multiprocessing
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any

from shipshape.errors import ShipshapeError
from shipshape.loadtest.plan import Plan
from shipshape.loadtest.precise import precise_loop
from shipshape.loadtest.records import Records, merged
from shipshape.loadtest.sending import Ending, Sender
from shipshape.loadtest.targets import target_at
from shipshape.loadtest.targets.address import Address
from shipshape.loadtest.targets.target import TargetError, TargetInfo

SPAWN = multiprocessing.get_context("spawn")  # a fork of a process that uses gRPC hangs
HEAD_START_S = 0.1  # from the order to start until the start
TICK_S = 0.25  # between two reports of a process

Watch = Callable[[list[Ending]], None]  # told of requests that have just ended


class Processes:
    """One or more processes with connections of their own, between which each plan is dealt out.

    Args:
        address: What they send to.
        count: How many.

    Raises:
        TargetError: The target cannot be tested.
    """

    def __init__(self, address: Address, count: int) -> None:
        self._pipes: list[Connection[Any, Any]] = []
        self._processes: list[BaseProcess] = []
        for _ in range(count):
            ours, theirs = SPAWN.Pipe()
            process = SPAWN.Process(target=_main, args=(theirs, address), daemon=True)
            process.start()
            theirs.close()
            self._pipes.append(ours)
            self._processes.append(process)
        try:
            self.info: TargetInfo = [self._receive(pipe) for pipe in self._pipes].pop()
        except BaseException:
            self.close(at_once=True)
            raise

    def __enter__(self) -> "Processes":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(at_once=kind is not None)

    def run(self, plan: Plan, watch: Watch | None = None) -> Records:
        """Send a plan and wait for its end.

        Args:
            plan: What to send.
            watch: Told several times a second of the requests that have ended since.

        Raises:
            TargetError: A process died.
        """
        for index, pipe in enumerate(self._pipes):
            _send(pipe, (plan.part(index, len(self._pipes)), watch is not None))
        for pipe in self._pipes:
            self._receive(pipe)  # prepared
        # All processes of a machine share one monotonic clock.
        start = time.monotonic() + HEAD_START_S + max(0.0, -float(plan.due.min(initial=0.0)))
        for pipe in self._pipes:
            _send(pipe, start)
        parts: dict[int, Records] = {}
        while len(parts) < len(self._pipes):
            waiting: dict[Any, int] = {pipe: index for index, pipe in enumerate(self._pipes) if index not in parts}
            for ready in wait(list(waiting)):
                message = self._receive(ready)
                if isinstance(message, Records):
                    parts[waiting[ready]] = message
                elif watch is not None:
                    watch(message)
        return merged([parts[index] for index in sorted(parts)])

    def close(self, *, at_once: bool = False) -> None:
        """End the processes; `at_once` whatever they are doing, else once they have disconnected."""
        for process, pipe in zip(self._processes, self._pipes, strict=True):
            pipe.close()
            if at_once:
                process.terminate()
            process.join()

    def _receive(self, pipe: Any) -> Any:
        try:
            message = pipe.recv()
        except (EOFError, ConnectionError) as error:
            raise _died() from error
        if isinstance(message, ShipshapeError):
            raise message
        return message


def _send(pipe: Any, message: Any) -> None:
    try:
        pipe.send(message)
    except ConnectionError as error:
        raise _died() from error


def _died() -> TargetError:
    return TargetError("expected the sending processes to live, got one that died: see above")


def _main(pipe: "Connection[Any, Any]", address: Address) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends us
    with asyncio.Runner(loop_factory=precise_loop) as runner:
        try:
            target = target_at(address)
            pipe.send(runner.run(target.open()))
        except ShipshapeError as error:
            pipe.send(error)
            return
        with suppress(EOFError):  # the parent has seen enough
            while True:
                plan, watched = pipe.recv()
                sender = Sender(target, plan, watched=watched)
                pipe.send("prepared")
                pipe.send(runner.run(_watched(sender, pipe.recv(), pipe)))
        runner.run(target.close())


async def _watched(sender: Sender, start: float, pipe: "Connection[Any, Any]") -> Records:
    telling = asyncio.create_task(_tell(sender, pipe))
    try:
        return await sender.run(start)
    finally:
        telling.cancel()


async def _tell(sender: Sender, pipe: "Connection[Any, Any]") -> None:
    while True:
        await asyncio.sleep(TICK_S)
        fresh, sender.fresh = sender.fresh, []
        if fresh:
            pipe.send(fresh)
