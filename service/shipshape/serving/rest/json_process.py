"""Large JSON is parsed in a process of its own: no thread could, without holding up the event loop.

Parsing keeps the interpreter's lock for tens of milliseconds, in which no other thread runs (docs/adr/0015). The
process is started by the first large body, and again when it has died.
"""

import asyncio
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import Pipe
from typing import Any, TypeVar

from shipshape.errors import DeadlineExceeded, NotReady
from shipshape.serving.encoding import Limits

T = TypeVar("T")
Parse = Callable[[bytes, str, Limits], T]
START_S = 120.0  # longest start: where compiled loops cannot be kept, they are compiled again
PARSE_S = 30.0  # longest body; the largest takes a second or two


class JsonProcess:
    """Parses bodies one at a time, in the order in which they came.

    Args:
        limits: Handed to the parsers.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="json")  # that talks to the process
        self._child: _Child | None = None

    async def parse(self, parse: Parse[T], body: bytes, query: str, seconds: float) -> T:
        """What `parse`, a function of `requests`, makes of `body`.

        Raises:
            InvalidInput: What `parse` raises.
            DeadlineExceeded: Not within `seconds`; a body that still waits is then never parsed.
            NotReady: The process died over it, or took so long that it was ended.
        """
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(seconds):
                reply: T | Exception = await loop.run_in_executor(self._thread, self._ask, parse, body, query)
        except TimeoutError as error:
            raise DeadlineExceeded("expected JSON to be read before the deadline, got no time for it") from error
        if isinstance(reply, Exception):
            raise reply
        return reply

    def close(self) -> None:
        """End the process; a body that is being parsed is given up."""
        if self._child is not None:
            self._child.kill()
        self._thread.shutdown(cancel_futures=True)
        self._end()

    def _ask(self, parse: Parse[T], body: bytes, query: str) -> Any:
        if self._child is not None and not self._child.alive:
            self._end()
        try:
            self._child = self._child or _Child()
            return self._child.ask((parse, query, self._limits), body)
        except (EOFError, OSError):
            self._end()
            return NotReady(
                "expected a process that parses JSON, got one that died over this body: "
                "send it again, or in a binary form"
            )

    def _end(self) -> None:
        if self._child is not None:
            self._child.end()
            self._child = None


class _Child:
    """One life of the process; `json_child` is what it runs."""

    def __init__(self) -> None:
        self._pipe, theirs = Pipe()
        with theirs:
            descriptor = theirs.fileno()
            command = [sys.executable, "-P", "-m", "shipshape.serving.rest.json_child", str(descriptor)]
            self._process = subprocess.Popen(command, pass_fds=[descriptor])
        self._started = False

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    def ask(self, request: Any, body: bytes) -> Any:
        """The reply; raises EOFError or OSError when the process dies instead."""
        if not self._started:
            self._within(START_S, self._pipe.recv)
            self._started = True

        def exchange() -> Any:
            """Ask and wait; raises EOFError or OSError when the process dies."""
            self._pipe.send(request)
            self._pipe.send_bytes(body)
            return self._pipe.recv()

        return self._within(PARSE_S, exchange)

    def kill(self) -> None:
        """Make it die, whatever it does."""
        self._process.kill()

    def end(self) -> None:
        """Leave nothing of it behind."""
        self._process.kill()
        self._process.wait()
        self._pipe.close()

    def _within(self, seconds: float, exchange: Callable[[], T]) -> T:
        watch = threading.Timer(seconds, self.kill)
        watch.daemon = True
        watch.start()
        try:
            return exchange()
        finally:
            watch.cancel()
