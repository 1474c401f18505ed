"""A request's body, read within its deadline and within what all bodies together may hold."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import TypeVar

from shipshape.errors import Cancelled, DeadlineExceeded, Overloaded
from shipshape.serving.encoding import Limits, check_body
from shipshape.serving.rest.incoming import Incoming
from shipshape.serving.rest.json_process import JsonProcess, Parse

T = TypeVar("T")
LARGE_JSON_BYTES = 256 * 2**10  # some 4,000 points: no thread holds the loop up for more than 3 ms over it
LARGEST_AT_ONCE = 8  # bodies of the largest size that may be held at the same time; thousands of usual ones


class Bodies:
    """All bodies that are being read, or wait to be parsed. Used on the event loop alone.

    Args:
        limits: Bound one body; all together may be `LARGEST_AT_ONCE` times as large.
        json: Parses JSON of more than `LARGE_JSON_BYTES`.
    """

    def __init__(self, limits: Limits, json: JsonProcess) -> None:
        self._json = json
        self._limits = limits
        self._held = 0

    @asynccontextmanager
    async def read(self, incoming: Incoming, seconds: float) -> AsyncIterator[bytes]:
        """The whole body, which counts until the block ends.

        Args:
            incoming: Its body must not have been read yet.
            seconds: What is left until the deadline.

        Raises:
            TooLarge: It is over the limit, as soon as that is known, whether its length was declared or not.
            Overloaded: All bodies together are.
            DeadlineExceeded: It did not arrive in time.
            Cancelled: The caller left half-way.
        """
        declared = incoming.header(b"content-length") or ""
        if declared.isdecimal():
            check_body(int(declared), self._limits)
        chunks: list[bytes] = []
        try:
            await self._in_time(chunks, incoming, seconds)
            yield b"".join(chunks)
        finally:
            self._held -= sum(map(len, chunks))

    async def parser(
        self, parse: Parse[T], body: bytes, query: str, seconds: float, *, json_bytes: int
    ) -> Callable[[], T]:
        """Gives what `parse` makes of a body: of large JSON before, in another process, else when it is called.

        Args:
            parse: A function of its module, which the other process imports.
            body: As `read`.
            query: For `parse`.
            seconds: What is left until the deadline.
            json_bytes: How much of the body is JSON.

        Raises:
            InvalidInput, DeadlineExceeded, NotReady: As `JsonProcess.parse`.
        """
        if json_bytes > LARGE_JSON_BYTES:
            parsed = await self._json.parse(parse, body, query, seconds)
            return lambda: parsed
        return lambda: parse(body, query, self._limits)

    async def _in_time(self, chunks: list[bytes], incoming: Incoming, seconds: float) -> None:
        if incoming.whole:  # as usual: no timer is needed
            await self._fill(chunks, incoming)
            return
        try:
            async with asyncio.timeout(seconds):
                await self._fill(chunks, incoming)
        except TimeoutError as error:
            raise DeadlineExceeded("expected the whole body before the deadline, got a part of it") from error

    async def _fill(self, chunks: list[bytes], incoming: Incoming) -> None:
        most = LARGEST_AT_ONCE * self._limits.max_body_bytes
        size = 0
        more = True
        while more:
            message = await incoming.receive()
            if message["type"] == "http.disconnect":
                raise Cancelled("the caller left before its request was complete")
            chunk, more = message["body"], message["more_body"]
            size += len(chunk)
            check_body(size, self._limits)
            if self._held + len(chunk) > most:
                raise Overloaded(f"expected at most {most} bytes of requests at a time, got more")
            self._held += len(chunk)
            chunks.append(chunk)
