"""The process that forks workers, as the service sees it; `fork_server` is what it runs."""

import os
import socket
import subprocess
import sys
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from shipshape.errors import Cancelled, NotReady
from shipshape.executor.messages import Inbox

STOP_S = 0.1  # between two looks whether to stop waiting
FORK = b"f"  # a message of one byte, for the socket to travel with
BUFFER = 4 * 2**20  # bytes a socket may hold, if the system allows: a scan need not wait for its reader
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class ForkServer:
    """One life of the process; it begins to prepare at once.

    Args:
        what: The function that prepares and its arguments, as a message.
    """

    def __init__(self, what: bytes) -> None:
        self.control, theirs = socket.socketpair()
        with theirs:
            descriptor = theirs.fileno()
            command = [sys.executable, "-P", "-m", "shipshape.executor.fork_server", str(descriptor)]
            self._process = subprocess.Popen(command, pass_fds=[descriptor], env={**os.environ, **ONE_THREAD})
        self.control.sendall(what)
        self.control.settimeout(STOP_S)
        self._inbox = Inbox()
        self._messages: deque[Any] = deque()

    def message(self, stopping: Callable[[], bool]) -> Any:
        """Wait for the next thing that it says of its preparation; raises as `ProcessCrew.prepared` does."""
        while not self._messages:
            if stopping():
                raise Cancelled("expected to end the warm-up, got a signal to stop")
            with suppress(TimeoutError):
                came = self._inbox.receive(self.control)
                if came is None:
                    raise NotReady("expected a process that loads the bundle, got one that ended before it had")
                self._messages.extend(came)
        first = self._messages.popleft()
        if isinstance(first, Exception):
            raise first
        return first

    def fork(self) -> socket.socket:
        """The connection to one more worker; raises OSError when the process has ended."""
        ours, theirs = socket.socketpair()
        with theirs:
            for end in (ours, theirs):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
            try:
                socket.send_fds(self.control, [FORK], [theirs.fileno()])
            except OSError:
                ours.close()
                raise
        return ours

    def end(self) -> None:
        """Leave nothing of it behind; its workers go on until their connections are closed."""
        self.control.close()
        self._process.kill()
        self._process.wait()
