"""Many scans over one long call: each answered when it is finished, sent again elsewhere when the call breaks."""

import asyncio
import time
from collections.abc import AsyncIterable, AsyncIterator, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from grpc import aio

from shipshape.client.answers import ScanAnswer
from shipshape.client.calls import Calls
from shipshape.client.failures import RETRYABLE, Silent, error_of, error_of_contact
from shipshape.client.local import Local, within
from shipshape.client.messages import from_wishes, to_results
from shipshape.client.route import choose
from shipshape.client.wishes import Wishes
from shipshape.errors import DeadlineExceeded, InvalidInput, ShipshapeError, Unreachable
from shipshape.types import Contact
from shipshape.v1 import shipshape_pb2 as pb

Scans = AsyncIterable[Sequence[Contact]] | Iterable[Sequence[Contact]]
LOOK_S = 0.1  # how often deadlines are looked at while nothing comes
GRACE_S = 0.05  # beyond a deadline for the service's own word on it
SHORTEST_MS = 1.0
LOST_STATUS = "Internal error from Core"  # what gRPC makes of any status that comes while a message is written


@dataclass(frozen=True, slots=True)
class _Scan:
    sequence: int
    contacts: list[Contact]
    deadline: float  # on the monotonic clock


class Streaming:
    """One stream of scans.

    Args:
        calls: To each endpoint, the preferred first.
        local: Answers when no endpoint can; None: nobody does.
        wishes: Hold for all contacts.
        timeout_s: Of each scan, from when it is taken.
        window: Scans that may be under way.
    """

    def __init__(
        self, calls: Sequence[Calls], local: Local | None, wishes: Wishes, timeout_s: float, window: int
    ) -> None:
        self._calls = {each.route: each for each in calls}
        self._local = local
        self._wishes = wishes
        self._timeout_s = timeout_s
        self._room = asyncio.Semaphore(window)
        self._fresh: asyncio.Queue[_Scan | None] = asyncio.Queue()  # None: there are no more
        self._ended = False
        self._waiting: dict[int, _Scan] = {}  # taken and not answered, by sequence
        self._wrong: dict[int, ScanAnswer] = {}  # of these, what no message can tell

    async def answers(self, scans: Scans) -> AsyncIterator[ScanAnswer]:
        """The answer to each scan, in the order in which they end; raises what `scans` raises, after the last."""
        reading = asyncio.ensure_future(self._read(scans))
        try:
            while not self._ended or self._waiting:
                now = time.monotonic()
                route = choose([*self._calls], now, self._timeout_s)
                if route is not None:
                    async for answer in self._over(self._calls[route]):
                        yield answer
                    continue
                await self._take(LOOK_S)
                for scan in [*self._waiting.values()] if self._local else self._late(0.0):
                    yield self._finish(scan, await self._without_service(scan))
            await reading
        finally:
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)

    async def _read(self, scans: Scans) -> None:
        try:
            sequence = 0
            async for contacts in _asynchronous(scans):
                await self._room.acquire()
                await self._fresh.put(_Scan(sequence, list(contacts), time.monotonic() + self._timeout_s))
                sequence += 1
        finally:
            self._fresh.put_nowait(None)

    async def _take(self, patience_s: float | None) -> _Scan | None:
        """The next scan, which waits for its answer from now on; None: none came within `patience_s`."""
        if self._ended:
            await asyncio.sleep(patience_s or 0.0)
            return None
        try:
            scan = await asyncio.wait_for(self._fresh.get(), patience_s)
        except TimeoutError:
            return None
        if scan is None:
            self._ended = True
        else:
            self._waiting[scan.sequence] = scan
        return scan

    async def _over(self, calls: Calls) -> AsyncIterator[ScanAnswer]:
        """The answers that come over one call, until it ends or breaks."""
        call = calls.stub.RecogniseStream(metadata=calls.endpoint.metadata())
        writing = asyncio.ensure_future(self._write(call, calls))
        reading: asyncio.Future[Any] = asyncio.ensure_future(call.read())
        try:
            while True:
                await asyncio.wait({reading}, timeout=LOOK_S)
                for unwritten in self._unwritten(writing):
                    yield unwritten
                if late := self._late(GRACE_S):
                    calls.route.told_silence(time.monotonic(), _silence(calls.endpoint.url), self._timeout_s)
                    for scan in late:
                        yield self._finish(scan, _late(scan, calls.endpoint.url))
                    return
                if not reading.done():
                    continue
                if (response := reading.result()) is aio.EOF:  # type: ignore[attr-defined]  # the stubs forget it
                    self._note_the_end(calls)
                    return
                reading = asyncio.ensure_future(call.read())
                if (answered := self._waiting.get(response.sequence)) is not None:
                    yield self._finish(answered, _answer(response, calls.endpoint.url))
        except aio.AioRpcError as error:
            failure = await self._explain(error, calls)
            calls.route.told_failure(time.monotonic(), failure)
        finally:
            for task in (writing, reading):
                task.cancel()
            call.cancel()
            await asyncio.gather(writing, reading, return_exceptions=True)

    def _note_the_end(self, calls: Calls) -> None:
        """A service that ends the call while scans wait for it is left alone for a while, as one that broke it."""
        if not self._ended or self._waiting.keys() - self._wrong.keys():
            why = Unreachable(f"expected a stream of {calls.endpoint.url} that holds, got one that ended")
            calls.route.told_failure(time.monotonic(), why)

    async def _explain(self, error: aio.AioRpcError, calls: Calls) -> ShipshapeError:
        """What ended a call; raised unless another call may go on."""
        failure = error_of(error, calls.endpoint.url)
        if error.details() == LOST_STATUS:
            try:
                await calls.capacity(0, self._wishes.lane, self._timeout_s)
            except ShipshapeError as plain:
                failure = plain
            else:
                return Unreachable(f"expected a stream of {calls.endpoint.url} that holds, got one that broke")
        if not isinstance(failure, (*RETRYABLE, DeadlineExceeded)):
            raise failure from error
        return failure

    async def _write(self, call: Any, calls: Calls) -> None:
        try:
            for scan in [*self._waiting.values()]:  # those that a call before this one did not answer
                await self._write_one(call, calls, scan)
            while not self._ended:
                if (fresh := await self._take(None)) is not None:
                    await self._write_one(call, calls, fresh)
            await call.done_writing()
        except (aio.AioRpcError, asyncio.InvalidStateError):
            return  # the call broke, and whoever reads from it is told why

    async def _write_one(self, call: Any, calls: Calls, scan: _Scan) -> None:
        try:
            message = self._message(scan, calls)
        except InvalidInput as error:
            self._wrong[scan.sequence] = ScanAnswer(scan.sequence, (), error)
        else:
            await call.write(message)

    def _unwritten(self, writing: asyncio.Future[None]) -> list[ScanAnswer]:
        """The answers to scans that no message can tell; raises what else kept them from being written."""
        if writing.done():
            writing.result()
        sequences = self._wrong.keys() & self._waiting.keys()
        return [self._finish(self._waiting[each], self._wrong.pop(each)) for each in sequences]

    def _message(self, scan: _Scan, calls: Calls) -> pb.RecogniseStreamRequest:
        left_s = scan.deadline - time.monotonic() - (calls.route.round_trip_s or 0.0)
        return pb.RecogniseStreamRequest(
            sequence=scan.sequence,
            contacts=[calls.encode(contact) for contact in scan.contacts],
            options=from_wishes(self._wishes),
            timeout_ms=max(SHORTEST_MS, left_s * 1e3),
        )

    def _late(self, grace_s: float) -> list[_Scan]:
        now = time.monotonic() - grace_s
        return [scan for scan in self._waiting.values() if scan.deadline <= now]

    def _finish(self, scan: _Scan, answer: ScanAnswer) -> ScanAnswer:
        del self._waiting[scan.sequence]
        self._room.release()
        return answer

    async def _without_service(self, scan: _Scan) -> ScanAnswer:
        if self._local is None:
            return _late(scan, ", ".join(route.url for route in self._calls))
        try:
            results = await within(scan.deadline, self._local.scan(scan.contacts, self._wishes))
        except DeadlineExceeded as error:
            return ScanAnswer(scan.sequence, (), error)
        return ScanAnswer(scan.sequence, results)


def _late(scan: _Scan, where: str) -> ScanAnswer:
    return ScanAnswer(scan.sequence, (), _silence(where))


def _silence(where: str) -> Silent:
    return Silent(f"expected an answer of {where} in time, got none")


def _answer(response: pb.RecogniseStreamResponse, endpoint: str) -> ScanAnswer:
    if response.HasField("error"):
        return ScanAnswer(response.sequence, (), error_of_contact(response.error))
    return ScanAnswer(response.sequence, to_results(response.results, endpoint))


async def _asynchronous(scans: Scans) -> AsyncIterator[Sequence[Contact]]:
    if isinstance(scans, AsyncIterable):
        async for scan in scans:
            yield scan
    else:
        for scan in scans:
            yield scan
            await asyncio.sleep(0)  # a long list must not hold up the answers
