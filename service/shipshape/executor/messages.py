"""Messages between the service and its worker processes: Python objects over a socket pair.

Both ends are ours and run the same code, so the objects are pickled; nothing from outside is ever unpickled.
"""

import pickle
import socket
import struct
from typing import Any

_LENGTH = struct.Struct("<I")
_CHUNK = 256 * 1024  # bytes read at a time


def packed(message: Any) -> bytes:
    """The bytes of one message."""
    body = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    return _LENGTH.pack(len(body)) + body


class Inbox:
    """Puts received bytes together to messages."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def receive(self, connection: socket.socket, flags: int = 0) -> list[Any] | None:
        """The messages that are complete after one more read; None when the other end is closed.

        Raises:
            BlockingIOError: Nothing is there, and `flags` or the socket say not to wait.
        """
        try:
            chunk = connection.recv(_CHUNK, flags)
        except ConnectionError:
            return None
        if not chunk:
            return None
        self._bytes += chunk
        return self._complete()

    def _complete(self) -> list[Any]:
        messages, start = [], 0
        view = memoryview(self._bytes)
        while len(view) - start >= _LENGTH.size:
            end = start + _LENGTH.size + _LENGTH.unpack_from(view, start)[0]
            if end > len(view):
                break
            messages.append(pickle.loads(view[start + _LENGTH.size : end]))
            start = end
        view.release()
        del self._bytes[:start]
        return messages
