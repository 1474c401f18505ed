"""The client, for asyncio."""

import asyncio
import contextlib
import math
import random
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

from shipshape.client.answers import Answer, Capacity, EndpointStatus, Info, Refusal, ScanAnswer
from shipshape.client.attempts import Attempts
from shipshape.client.calls import Calls
from shipshape.client.endpoint import Endpoint, as_endpoint
from shipshape.client.failures import RETRYABLE
from shipshape.client.local import Local, within
from shipshape.client.route import Route
from shipshape.client.streaming import Scans, Streaming
from shipshape.client.wishes import Wishes
from shipshape.errors import DeadlineExceeded, FileError, SettingsError, ShipshapeError
from shipshape.executor import Lane
from shipshape.types import Contact

T = TypeVar("T")
LONGEST_S = 3600.0  # a service takes no longer deadline
WINDOW = 8  # scans of a stream that may be under way


class AsyncClient:
    """Calls one or several services; used in one event loop, opened with `async with`.

    The first endpoint that is expected to answer within its service's budget is asked, else the quickest; where
    there are several, each is asked in the background for its health and capacity. Every call has a deadline.

    Args:
        endpoints: URLs such as grpc://127.0.0.1:50051, or `Endpoint`s; the preferred first.
        timeout_s: Deadline of calls that set none, seconds.
        hedge: Send to a second endpoint what takes longer than 95 in 100 answers, and take the first that comes.
        local: Compute in this process what no endpoint answers; a path: with that bundle. Needs the whole package.

    Raises:
        SettingsError: No endpoint, a URL that is none, or a deadline that cannot be kept.
    """

    def __init__(
        self,
        *endpoints: Endpoint | str,
        timeout_s: float = 1.0,
        hedge: bool = False,
        local: bool | Path = False,
    ) -> None:
        if not endpoints and local is False:
            raise SettingsError("expected an endpoint, or local=True to compute in this process, got neither")
        self._endpoints = [as_endpoint(each) for each in endpoints]
        self._timeout_s = _checked(timeout_s)
        self._hedge = hedge
        self._wants_local = local
        self._local: Local | None = None
        self._calls: dict[Route, Calls] = {}
        self._watching: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> Self:
        """Open it: connections come with the first call, a pipeline of its own now.

        Raises:
            FileError: A PEM file cannot be read.
            BundleError: `local` has no bundle.
        """
        if self._wants_local is not False:
            folder = self._wants_local if isinstance(self._wants_local, Path) else None
            self._local = await asyncio.to_thread(Local, folder)
        dice = random.Random()
        try:
            for endpoint in self._endpoints:
                route = Route(endpoint.url, endpoint.link, dice)
                self._calls[route] = Calls(endpoint, route)
        except FileError:
            await self.__aexit__(None, None, None)
            raise
        if len(self._calls) > 1:
            self._watching = [asyncio.create_task(self._watch(calls)) for calls in self._calls.values()]
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it; calls under way are cancelled."""
        for task in self._watching:
            task.cancel()
        await asyncio.gather(*self._watching, return_exceptions=True)
        for calls in self._calls.values():
            await calls.close()
        self._calls, self._watching, self._local = {}, [], None

    async def recognise(
        self, contact: Contact, wishes: Wishes | None = None, *, timeout_s: float | None = None
    ) -> Answer:
        """The answer to one contact.

        Raises:
            InvalidInput: The contact is none; TooLarge and Unprocessable say which way.
            DeadlineExceeded: There is no answer in time.
            Overloaded, NotReady, Unreachable: No endpoint takes it, and there is no time to ask again.
            Unauthenticated, ServiceFault: Asking again would not help.
        """
        chosen = wishes or Wishes()
        return await self._answer(
            lambda calls, left_s: calls.recognise(contact, chosen, left_s),
            lambda local: local.recognise(contact, chosen),
            timeout_s,
            contacts=1,
        )

    async def scan(
        self, contacts: Sequence[Contact], wishes: Wishes | None = None, *, timeout_s: float | None = None
    ) -> tuple[Answer | Refusal, ...]:
        """One result a contact, in their order; all are admitted together or none. Raises as `recognise`."""
        chosen, all_of_them = wishes or Wishes(), list(contacts)
        return await self._answer(
            lambda calls, left_s: calls.scan(all_of_them, chosen, left_s),
            lambda local: local.scan(all_of_them, chosen),
            timeout_s,
            contacts=len(all_of_them),
        )

    async def stream(
        self, scans: Scans, wishes: Wishes | None = None, *, timeout_s: float | None = None, window: int = WINDOW
    ) -> AsyncIterator[ScanAnswer]:
        """An answer a scan, as soon as it is there, in any order; a scan that fails does not end the stream.

        A broken connection is opened again, elsewhere if need be, and what had no answer is sent again.

        Args:
            scans: Contacts of each scan, 1 to 256; taken only when fewer than `window` scans have no answer yet.
            wishes: Hold for all of them.
            timeout_s: Of each scan.
            window: Scans that may be under way.

        Raises:
            SettingsError: A window of none.
            ShipshapeError: What no other call would mend, and what `scans` raises.
        """
        if window < 1:
            raise SettingsError(f"expected a window of 1 scan or more, got {window}")
        streaming = Streaming(
            [*self._opened().values()], self._local, wishes or Wishes(), self._limit(timeout_s), window
        )
        async with contextlib.aclosing(streaming.answers(scans)) as answers:  # type: ignore[type-var]
            async for answer in answers:
                yield answer

    async def capacity(
        self, points: int = 300, lane: Lane = Lane.TRACKING, *, timeout_s: float | None = None
    ) -> dict[str, Capacity | ShipshapeError]:
        """What each endpoint would promise a contact of so many points now, or why it says nothing; by its URL."""
        return await self._of_each(lambda calls: calls.capacity(points, lane, self._limit(timeout_s)))

    async def info(self, *, timeout_s: float | None = None) -> dict[str, Info | ShipshapeError]:
        """What each endpoint runs and takes, or why it says nothing; by its URL."""
        return await self._of_each(lambda calls: calls.info(self._limit(timeout_s)))

    def status(self) -> list[EndpointStatus]:
        """What is known of each endpoint, in their order; asks nobody."""
        now = time.monotonic()
        return [
            EndpointStatus(
                route.url,
                route.rests_until > now,
                route.failure,
                route.round_trip_s,
                route.expected_s,
                route.load,
            )
            for route in self._calls
        ]

    async def probe(self) -> list[EndpointStatus]:
        """Ask every endpoint for its health and capacity now; then as `status`."""
        await asyncio.gather(*map(self._probe, self._opened().values()))
        return self.status()

    async def _answer(
        self,
        send: Callable[[Calls, float], Awaitable[T]],
        compute: Callable[[Local], Awaitable[T]],
        timeout_s: float | None,
        contacts: int,
    ) -> T:
        opened, left_s, local = self._opened(), self._limit(timeout_s), self._local
        deadline = time.monotonic() + left_s
        if local is None:
            return await Attempts(
                [*opened], lambda route, s: send(opened[route], s), left_s, hedge=self._hedge
            ).run()
        if opened:
            # A service that is silent must leave the time to compute here.
            left_s = max(left_s / 2, left_s - contacts * local.reserve_s)
            attempts = Attempts(
                [*opened], lambda route, s: send(opened[route], s), left_s, hedge=self._hedge, wait=False
            )
            with contextlib.suppress(*RETRYABLE, DeadlineExceeded):
                return await attempts.run()
        return await within(deadline, compute(local))

    async def _of_each(self, ask: Callable[[Calls], Awaitable[T]]) -> dict[str, T | ShipshapeError]:
        async def told(calls: Calls) -> T | ShipshapeError:
            """What one endpoint says, or why it says nothing."""
            try:
                return await ask(calls)
            except ShipshapeError as error:
                return error

        opened = self._opened().values()
        every = await asyncio.gather(*map(told, opened))
        return {calls.endpoint.url: each for calls, each in zip(opened, every, strict=True)}

    async def _watch(self, calls: Calls) -> None:
        while True:
            await self._probe(calls)
            await asyncio.sleep(calls.endpoint.link.probe_s)

    async def _probe(self, calls: Calls) -> None:
        try:
            await calls.probe(calls.endpoint.link.probe_s)
        except ShipshapeError as error:
            calls.route.told_failure(time.monotonic(), error)

    def _opened(self) -> dict[Route, Calls]:
        if not self._calls and self._local is None:
            raise SettingsError("expected an open client, got one outside its `with` block")
        return self._calls

    def _limit(self, timeout_s: float | None) -> float:
        return self._timeout_s if timeout_s is None else _checked(timeout_s)


def _checked(timeout_s: float) -> float:
    if not 0 < timeout_s <= LONGEST_S or math.isnan(timeout_s):
        raise SettingsError(f"expected timeout_s above 0 and up to {LONGEST_S:.0f}, got {timeout_s}")
    return timeout_s
