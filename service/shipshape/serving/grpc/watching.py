"""grpc.health.v1 whose watchers cannot hold each other up.

The servicer of grpc_health, as it comes, sends to watchers while it holds its lock, and waits until the thread
that serves all calls has seen it sent; that thread waits for the same lock when a watcher leaves. Two watchers are
enough to stop the door for good. Its other way gives each watcher a thread, so they have a few places.
"""

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import grpc
from grpc_health.v1 import health

PLACES = 32  # watchers at a time; balancers and probes are few


class WatchedHealth(health.HealthServicer):
    """Answers as grpc_health does; RESOURCE_EXHAUSTED to one watcher too many."""

    def __init__(self) -> None:
        # One thread more than places, for the refusal.
        pool = ThreadPoolExecutor(PLACES + 1, thread_name_prefix="grpc-health")
        super().__init__(experimental_non_blocking=False, experimental_thread_pool=pool)
        self._places = threading.BoundedSemaphore(PLACES)

    def Watch(self, request: Any, context: Any, send_response_callback: Any = None) -> Any:
        """The status now and after every change."""
        if not self._places.acquire(blocking=False):
            context.abort(
                grpc.StatusCode.RESOURCE_EXHAUSTED, f"expected at most {PLACES} watchers at a time, got one more"
            )
        if not context.add_callback(self._places.release):  # the caller has left already
            self._places.release()
            return iter(())
        return super().Watch(request, context, send_response_callback)
