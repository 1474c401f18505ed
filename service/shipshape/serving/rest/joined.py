"""An answer leaves in one piece: a call of the system for its head and one for its body cost twice as much."""

from asyncio import Transport

_CONTINUE = b"HTTP/1.1 100 "  # the one head that no body follows


class Joined:
    """What uvicorn writes an answer to: holds the head back until some of the body is there, or the end.

    Args:
        transport: Of the connection.
    """

    __slots__ = ("_head", "_transport")

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._head = b""

    def write(self, data: bytes) -> None:
        """The head of an answer, or some of its body; nothing is written to a client that has left."""
        if self._transport.is_closing():
            return
        if not self._head and data.startswith(b"HTTP/1.1 ") and not data.startswith(_CONTINUE):
            self._head = data
        else:
            self._transport.write(self._head + data)
            self._head = b""

    def flush(self) -> None:
        """The answer is complete, whether it had a body or not."""
        if self._head:
            self.write(b"")

    def is_closing(self) -> bool:
        """Whether nothing can be written any more."""
        return self._transport.is_closing()

    def close(self) -> None:
        """Close the connection, once all was sent."""
        self.flush()
        self._transport.close()
