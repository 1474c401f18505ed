"""The process behind `JsonProcess`: parses one body after the other, until nobody is left to ask.

It runs as `python -m shipshape.serving.rest.json_child FD`, FD being its end of the pipe. Each request is a
function of `requests` with its arguments, then the body; each reply is what it returns, or the error it raises.
"""

import signal
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from shipshape.errors import ShipshapeError
from shipshape.serving.encoding import Limits


def main(pipe: "Connection[Any, Any]") -> None:
    """Say that it is ready, then answer until the other end of the pipe is closed."""
    for number in (signal.SIGINT, signal.SIGTERM):  # meant for the service, which still wants its answers
        signal.signal(number, signal.SIG_IGN)
    with suppress(EOFError, OSError):
        pipe.send(None)
        while True:
            parse, query, limits = pipe.recv()
            pipe.send(_reply(parse, pipe.recv_bytes(), query, limits))


def _reply(parse: Callable[..., Any], body: bytes, query: str, limits: Limits) -> Any:
    try:
        return parse(body, query, limits)
    except ShipshapeError as error:
        return error
    except Exception:  # of any class, also of one that could not travel
        return RuntimeError(f"the JSON process failed: {traceback.format_exc()}")


if __name__ == "__main__":
    main(Connection(int(sys.argv[1])))
