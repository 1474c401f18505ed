"""The client, for programs without an event loop; threads may share one."""

import asyncio
import os
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Iterator, Sequence
from concurrent.futures import Future
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from shipshape.client.aio import WINDOW, AsyncClient
from shipshape.client.answers import Answer, Capacity, EndpointStatus, Info, Refusal, ScanAnswer
from shipshape.client.endpoint import Endpoint
from shipshape.client.wishes import Wishes
from shipshape.errors import ShipshapeError
from shipshape.executor import Lane
from shipshape.types import Contact

T = TypeVar("T")
_END: Any = object()


class Client:
    """As `AsyncClient`, for `with`; each method waits for its answer, and means and raises what it does there."""

    def __init__(
        self,
        *endpoints: Endpoint | str,
        timeout_s: float = 1.0,
        hedge: bool = False,
        local: bool | Path = False,
    ) -> None:
        self._client = AsyncClient(*endpoints, timeout_s=timeout_s, hedge=hedge, local=local)

    def __enter__(self) -> Self:
        """Open it."""
        _wait(self._client.__aenter__())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it; calls of other threads are cancelled."""
        _wait(self._client.__aexit__(kind, error, trace))

    def recognise(
        self, contact: Contact, wishes: Wishes | None = None, *, timeout_s: float | None = None
    ) -> Answer:
        """The answer to one contact."""
        return _wait(self._client.recognise(contact, wishes, timeout_s=timeout_s))

    def scan(
        self, contacts: Sequence[Contact], wishes: Wishes | None = None, *, timeout_s: float | None = None
    ) -> tuple[Answer | Refusal, ...]:
        """One result a contact, in their order."""
        return _wait(self._client.scan(contacts, wishes, timeout_s=timeout_s))

    def stream(
        self,
        scans: Iterable[Sequence[Contact]],
        wishes: Wishes | None = None,
        *,
        timeout_s: float | None = None,
        window: int = WINDOW,
    ) -> Iterator[ScanAnswer]:
        """An answer a scan, as soon as it is there, in any order; `scans` may block: a thread reads it."""
        answers = self._client.stream(_threaded(scans), wishes, timeout_s=timeout_s, window=window)
        try:
            while (answer := _wait(_next(answers))) is not None:
                yield answer
        finally:
            _wait(_close(answers))

    def capacity(
        self, points: int = 300, lane: Lane = Lane.TRACKING, *, timeout_s: float | None = None
    ) -> dict[str, Capacity | ShipshapeError]:
        """What each endpoint would promise now, or why it says nothing; by its URL."""
        return _wait(self._client.capacity(points, lane, timeout_s=timeout_s))

    def info(self, *, timeout_s: float | None = None) -> dict[str, Info | ShipshapeError]:
        """What each endpoint runs and takes, or why it says nothing; by its URL."""
        return _wait(self._client.info(timeout_s=timeout_s))

    def status(self) -> list[EndpointStatus]:
        """What is known of each endpoint, in their order; asks nobody."""
        return self._client.status()

    def probe(self) -> list[EndpointStatus]:
        """Ask every endpoint for its health and capacity now; then as `status`."""
        return _wait(self._client.probe())


_starting = threading.Lock()
_loop: asyncio.AbstractEventLoop | None = None
_process = 0  # whose loop it is


def _background() -> asyncio.AbstractEventLoop:
    """The event loop of all clients of this process: gRPC is at its best with one."""
    global _loop, _process
    with _starting:
        if _loop is None or _process != os.getpid():  # its thread did not come along when this process was forked
            _loop, _process = asyncio.new_event_loop(), os.getpid()
            threading.Thread(target=_loop.run_forever, name="shipshape-client", daemon=True).start()
        return _loop


def _wait(work: Coroutine[Any, Any, T]) -> T:
    """What `work` returns; an interrupt of the caller cancels it."""
    future = asyncio.run_coroutine_threadsafe(work, _background())
    try:
        return future.result()
    except BaseException:
        future.cancel()
        raise


async def _next(answers: AsyncIterator[ScanAnswer]) -> ScanAnswer | None:
    return await anext(answers, None)


async def _close(answers: AsyncIterator[ScanAnswer]) -> None:
    await answers.aclose()  # type: ignore[attr-defined]  # it is an asynchronous generator


async def _threaded(scans: Iterable[Sequence[Contact]]) -> AsyncIterator[Sequence[Contact]]:
    iterator = iter(scans)
    while (scan := await _aside(lambda: next(iterator, _END))) is not _END:
        yield scan


async def _aside(work: Callable[[], T]) -> T:
    """What `work` returns, done in a thread that keeps no program from ending, however long it blocks."""
    future: Future[T] = Future()
    future.set_running_or_notify_cancel()

    def run() -> None:
        """Until `work` ends, though nobody may wait for it any more."""
        try:
            future.set_result(work())
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, name="shipshape-scans", daemon=True).start()
    return await asyncio.wrap_future(future)
