"""All calls of RecogniseStream: so many at a time, each with a reader beside the thread that gRPC gives it."""

import threading
from collections.abc import Iterator
from contextvars import copy_context
from functools import partial
from typing import Any

import grpc

from shipshape.errors import NotReady, Overloaded
from shipshape.serving.access import Access
from shipshape.serving.core import Core
from shipshape.serving.grpc.callers import client_of
from shipshape.serving.grpc.stream import Stream
from shipshape.serving.timing import Timeouts
from shipshape.telemetry import Metrics

STREAMS = 32  # at a time; each holds two threads, also while its caller is silent


class Streams:
    """Serves streams until `stop`.

    Args:
        core: Answers.
        metrics: Told of every message.
        timeouts: Deadline of messages that set none.
        access: Who calls, and what each may ask.
    """

    def __init__(self, core: Core, metrics: Metrics, timeouts: Timeouts, access: Access) -> None:
        self._core = core
        self._metrics = metrics
        self._timeouts = timeouts
        self._access = access
        self._changed = threading.Lock()  # guards everything below
        self._open: set[Stream] = set()
        self._stopping = False

    def serve(self, requests: Iterator[Any], context: grpc.ServicerContext) -> Iterator[bytes]:
        """The responses to the messages of one call.

        Raises:
            NotReady: The service is starting, or it is stopping and all that was read has been answered.
            Overloaded: No place for another stream.
            InvalidInput: `requests` had something that is no message; raised after the last answer.
        """
        self._core.model()
        client = client_of(context, self._access)
        stream, done = self._enter(client), threading.Event()
        # The call's end wakes the reader; only then, with both its threads free, is the place free.
        reading = copy_context().run  # so that the log knows the request's id
        reader = threading.Thread(
            target=reading, args=(self._read, stream, requests, done), name="grpc-reader", daemon=True
        )
        try:
            reader.start()
        except RuntimeError as error:  # no thread is left for it, and nobody else would give the place back
            self._leave(stream)
            raise Overloaded("expected a thread for another stream, got none: come back later") from error
        try:
            if not context.add_callback(stream.leave):  # it has ended already
                stream.leave()
            yield from stream.answers()
        finally:
            done.set()

    def stop(self) -> None:
        """Take no more streams or messages; each stream ends with NotReady once what it has read is answered."""
        with self._changed:
            self._stopping = True
            streams = list(self._open)
        for stream in streams:
            stream.end(_stopping())

    def _enter(self, client: str) -> Stream:
        with self._changed:
            if self._stopping:
                raise _stopping()
            if len(self._open) >= STREAMS:
                raise Overloaded(f"expected at most {STREAMS} streams at a time, got one more")
            share = partial(self._access.clients.share, client)
            stream = Stream(self._core, self._metrics, self._timeouts, share)
            self._open.add(stream)
            return stream

    def _read(self, stream: Stream, requests: Iterator[Any], done: threading.Event) -> None:
        try:
            stream.read(requests)
            done.wait()
        finally:
            self._leave(stream)

    def _leave(self, stream: Stream) -> None:
        with self._changed:
            self._open.discard(stream)


def _stopping() -> NotReady:
    return NotReady("expected a running service, got one that is stopping")
