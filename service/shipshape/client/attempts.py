"""One request -> attempts at one endpoint after the other, all of them within its deadline.

Only what is safe and may help is tried again: endpoints that are not there, and refusals of a full queue, whose
own advice on when to come back is kept. A hedge is a second attempt beside one that is slower than usual.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Generic, TypeVar

from shipshape.client.failures import RETRYABLE, Silent
from shipshape.client.route import Route, choose
from shipshape.errors import DeadlineExceeded, Overloaded, ShipshapeError, Unreachable

T = TypeVar("T")
Send = Callable[[Route, float], Awaitable[T]]  # to a route, within so many seconds; raises ShipshapeError
CROWDED_S = 0.02  # until a refusal without advice is asked again


class Attempts(Generic[T]):
    """Those of one request.

    Args:
        routes: All endpoints, the preferred first.
        send: Makes one attempt.
        timeout_s: From now, for all of them together.
        hedge: Whether to send to a second endpoint what takes longer than 95 in 100 answers of the first.
        wait: Whether to wait for an endpoint when none can be asked now; if not, its error is raised at once.
    """

    def __init__(
        self, routes: Sequence[Route], send: Send[T], timeout_s: float, *, hedge: bool = False, wait: bool = True
    ) -> None:
        self._routes = routes
        self._send = send
        self._deadline = time.monotonic() + timeout_s
        self._hedge = hedge
        self._wait = wait
        self._not_before: dict[Route, float] = {}  # of this request alone: another lane may have room
        self._last: ShipshapeError | None = None

    async def run(self) -> T:
        """The first answer.

        Raises:
            DeadlineExceeded: There is none in time.
            ShipshapeError: The error of the last attempt, when another would not help or has no time left.
        """
        while True:
            now = time.monotonic()
            if now >= self._deadline:
                raise self._last or DeadlineExceeded("expected an answer in time, got none")
            route = choose(self._open(now), now, self._deadline - now) or self._last_hope()
            if route is None:
                await self._rest(now)
                continue
            try:
                return await self._hedged(route)
            except RETRYABLE as error:
                self._last = error

    def _open(self, now: float) -> list[Route]:
        return [route for route in self._routes if self._not_before.get(route, 0.0) <= now]

    def _last_hope(self) -> Route | None:
        """Where all rest until it is too late, the one that rests least: its failure may be over by now."""
        if not self._wait or self._last is not None:
            return None
        soonest = min(self._routes, key=lambda route: route.rests_until)
        return soonest if soonest.rests_until >= self._deadline else None

    async def _rest(self, now: float) -> None:
        wakes = min(max(route.rests_until, self._not_before.get(route, 0.0)) for route in self._routes)
        if not self._wait or wakes >= self._deadline:
            failures = "; ".join(str(route.failure) for route in self._routes if route.failure)
            raise self._last or Unreachable(f"expected an endpoint that can be asked now, got none: {failures}")
        await asyncio.sleep(wakes - now)

    async def _hedged(self, route: Route) -> T:
        first = asyncio.create_task(self._once(route))
        racing = {first}
        try:
            if (
                self._hedge
                and route.p95_s is not None
                and not (await asyncio.wait(racing, timeout=route.p95_s))[0]
            ):
                now = time.monotonic()
                others = [each for each in self._open(now) if each is not route]
                if (second := choose(others, now, self._deadline - now)) is not None:
                    racing.add(asyncio.create_task(self._once(second)))
            return await _first_answer(racing)
        finally:
            for attempt in racing:
                attempt.cancel()  # does nothing to one that has ended
            await asyncio.gather(*racing, return_exceptions=True)

    async def _once(self, route: Route) -> T:
        started = time.monotonic()
        route.outstanding += 1
        try:
            return await self._send(route, self._deadline - started)
        except Overloaded as error:
            rest = CROWDED_S if error.retry_after_s is None else error.retry_after_s
            self._not_before[route] = time.monotonic() + max(rest, CROWDED_S)
            raise
        except RETRYABLE as error:
            route.told_failure(time.monotonic(), error)
            self._not_before[route] = route.rests_until  # whatever a probe says meanwhile
            raise
        except Silent as error:
            now = time.monotonic()
            route.told_silence(now, error, now - started)
            raise
        finally:
            route.outstanding -= 1


async def _first_answer(racing: set[asyncio.Task[T]]) -> T:
    """That of the first attempt that succeeds, else the last error; one that is not retryable ends them all."""
    left = set(racing)
    while True:
        done, left = await asyncio.wait(left, return_when=asyncio.FIRST_COMPLETED)
        for attempt in done:
            if attempt.exception() is None:
                return attempt.result()
        for attempt in done:
            error = attempt.exception()
            if error is not None and (not left or not isinstance(error, RETRYABLE)):
                raise error
