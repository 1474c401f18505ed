"""The process that loads what the workers need, once, and forks them: they share its memory and start in no time.

It runs as `python -m shipshape.executor.fork_server FD`, FD being its end of a socket pair. The first message
says what to prepare; the replies are None when all is loaded, then a description of it, or an error instead. After
that, each message that carries a socket is a request for one more worker at its other end. It has one thread,
which is what makes it safe to fork.

The processes end when the sockets close, however the service ends; signals are the service's matter.
"""

import gc
import os
import pkgutil
import signal
import socket
import sys
from contextlib import suppress
from functools import partial
from typing import Any

from shipshape.executor.messages import Inbox, packed
from shipshape.executor.process_worker import Prepared, as_message, be_worker

LOADED = packed(None)


def main(control: socket.socket) -> None:
    """Prepare, then fork a worker for each socket that comes."""
    for number in (signal.SIGINT, signal.SIGTERM):  # meant for the service, which still wants its answers
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody asks how a worker ended: its socket tells that it did
    prepare, arguments = _first(control)
    with suppress(OSError):  # the service ended meanwhile
        try:
            prepared: Prepared = pkgutil.resolve_name(prepare)(partial(control.sendall, LOADED), *arguments)
            control.sendall(packed(prepared.description))
        except Exception as error:
            control.sendall(packed(as_message(error)))
            return
        _fork_for_all_that_come(control, prepared)


def _fork_for_all_that_come(control: socket.socket, prepared: Prepared) -> None:
    gc.collect()
    gc.freeze()  # a collection in a worker would touch, and so copy, every page that it shares
    while True:
        _, descriptors, _, _ = socket.recv_fds(control, 1, 1)
        if not descriptors:
            return
        theirs = socket.socket(fileno=descriptors[0])
        if os.fork() == 0:
            control.close()
            be_worker(theirs, prepared)
        theirs.close()


def _first(control: socket.socket) -> Any:
    inbox = Inbox()
    while (messages := inbox.receive(control)) is not None:
        if messages:
            return messages[0]
    raise SystemExit  # the service ended before it had said anything


if __name__ == "__main__":
    main(socket.socket(fileno=int(sys.argv[1])))
