"""gRPC reflection within bounds: a stream holds a thread of the door for as long as its caller likes."""

import threading
from collections.abc import Iterator
from typing import Any

import grpc
from grpc_reflection.v1alpha import reflection, reflection_pb2_grpc

PLACES = 4  # streams at a time; each holds one of the door's threads, also while its caller is silent
LONGEST_S = 60.0  # of a stream; tools ask what they want within a second


class BoundedReflection(reflection.ReflectionServicer):
    """Answers as grpc_reflection does, to a few callers at a time and to none for long."""

    def __init__(self, names: tuple[str, ...], *, longest_s: float = LONGEST_S) -> None:
        super().__init__(names)
        self._places = threading.BoundedSemaphore(PLACES)
        self._longest_s = longest_s

    # The stubs type the parent's arguments as generated messages, which this pass-through need not know.
    def ServerReflectionInfo(self, request_iterator: Any, context: Any) -> Iterator[Any]:  # type: ignore[override]
        """The stream of questions and answers; RESOURCE_EXHAUSTED when no place is left."""
        if not self._places.acquire(blocking=False):
            context.abort(
                grpc.StatusCode.RESOURCE_EXHAUSTED,
                f"expected at most {PLACES} reflection streams at a time, got one more",
            )
        end = threading.Timer(self._longest_s, context.cancel)
        end.daemon = True
        end.start()
        try:
            answers: Any = super().ServerReflectionInfo(request_iterator, context)
            yield from answers
        finally:
            end.cancel()
            self._places.release()


def add_reflection(names: tuple[str, ...], server: grpc.Server) -> None:
    """Let `server` tell its contract under the service `names`."""
    reflection_pb2_grpc.add_ServerReflectionServicer_to_server(
        BoundedReflection((*names, reflection.SERVICE_NAME)), server
    )
