"""What the REST door itself costs: CPU of its thread a request, with a core that answers or refuses at once.

Example:
    python -m benchmarks.rest_door

Prints microseconds of CPU a request, and how many requests that was measured over. The clock is that of the
thread, so what else the machine does matters little.
"""

import math
import multiprocessing
import queue
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

import numpy as np
from prometheus_client import CollectorRegistry

from benchmarks.serving.client import closed
from benchmarks.serving.wires import Wire, plain
from shipshape.budget import Budget
from shipshape.errors import Overloaded
from shipshape.executor import Executor, Ticket
from shipshape.serving.access import Access
from shipshape.serving.core import Core
from shipshape.serving.encoding import Limits
from shipshape.serving.health import Health
from shipshape.serving.model import Answer, Reply
from shipshape.serving.rest.app import build_app
from shipshape.serving.rest.server import RestDoor
from shipshape.serving.timing import Timeouts
from shipshape.telemetry import Metrics
from shipshape.types import Box, Preset, Recognition, ReferenceBox, RestoredCloud, Rung

SECONDS, ROUNDS, POINTS = 3.0, 3, 300
STAGES = ("prior", "heading", "bow_stern", "projection", "inpainting", "lifting", "keypoints", "spd2", "class")
VESSELS = ("tug", "rhib", "ferry", "cargo", "sail", "unknown")


def main() -> None:
    """Print the table."""
    print("            CPU of the door, us a request    requests")
    for name, kind in (("accepted", AtOnce), ("refused", Full)):
        spent = [cpu_a_request(kind) for _ in range(ROUNDS)]
        microseconds, requests = min(spent)
        print(f"{name:10s} {microseconds:30.1f} {requests:12d}")


class AtOnce(Core):
    """A core whose answers are known beforehand; another thread hands them over, as workers do."""

    def __init__(self, executor: Executor) -> None:
        super().__init__(executor, Limits())
        self._tickets = queue.SimpleQueue()
        threading.Thread(target=self._settle, daemon=True).start()

    def model(self):
        """None is needed."""

    def check(self, lane, deadline) -> None:
        """Nothing is refused."""

    def submit(self, model, order, deadline):
        """A ticket that will be settled in a moment."""
        ticket = Ticket(deadline, time.monotonic)
        self._tickets.put((ticket, order))
        return ticket

    def _settle(self) -> None:
        while True:
            ticket, order = self._tickets.get()
            content = order.encode(Answer(order.contact, RECOGNITION), order.wishes)
            ticket.succeed(Reply(content, RECOGNITION.rung, RECOGNITION.stage_ms))


class Full(AtOnce):
    """A core that has no place left."""

    def check(self, lane, deadline) -> None:
        """Refused before the body is read."""
        self.submit(None, None, deadline)

    def submit(self, model, order, deadline):
        """Refused."""
        raise Overloaded("expected at most 0 more in the queue of 512, got 1", retry_after_s=0.5)


def cpu_a_request(kind: type[AtOnce]) -> tuple[float, int]:
    """Microseconds of the door's thread a request, and the number of requests."""
    points = np.random.default_rng(0).random((POINTS, 3), np.float32)
    body = points.tobytes()
    head = (
        "POST /v1/recognise?lowest_rung=full HTTP/1.1\r\nHost: localhost\r\n"
        f"Content-Type: application/octet-stream\r\nContent-Length: {len(body)}\r\n\r\n"
    )
    wire = Wire("http", (head.encode() + body,), plain)
    spawn = multiprocessing.get_context("spawn")
    with door(kind) as port, ProcessPoolExecutor(1, mp_context=spawn) as client:
        client.submit(closed, wire, port, 0.5).result()
        (thread,) = [thread for thread in threading.enumerate() if thread.name == "rest"]
        clock = time.pthread_getcpuclockid(thread.ident)
        before = time.clock_gettime(clock)
        load = client.submit(closed, wire, port, SECONDS).result()
        spent = time.clock_gettime(clock) - before
    requests = sum(load.statuses.values())
    return spent / requests * 1e6, requests


@contextmanager
def door(kind: type[AtOnce]):
    """The REST door on a core of this kind; its port."""
    executor = Executor(1, 512)
    metrics, health = Metrics(CollectorRegistry(), Budget(0.05)), Health(executor)
    app = build_app(kind(executor), metrics, Timeouts(), Access(), health)
    listener = RestDoor(app, None, on_death=lambda: None)
    yield listener.start("127.0.0.1", 0)
    listener.stop(1.0)
    executor.stop(1.0)


RECOGNITION = Recognition(
    vessel="tug",
    probability=0.75,
    probabilities=dict.fromkeys(VESSELS, 1 / len(VESSELS)),
    unknown=False,
    reasons=(),
    heading=0.5,
    heading_std=0.0625,
    bow_probability=0.875,
    aspect_deg=math.degrees(0.5),
    true_heading_deg=None,
    box=Box((40.0, 1.5, -2.0), ReferenceBox(20.0, 8.0, 10.0)),
    restored=RestoredCloud(np.zeros((0, 3), np.float32), np.zeros(0, bool)),
    images=None,
    keypoints_level=np.random.default_rng(1).random((20, 3), np.float32),
    rung=Rung.FULL,
    rung_reason="",
    preset=Preset.BEST,
    image_method=None,
    bundle="ab" * 32,
    stage_ms=dict.fromkeys(STAGES, 0.25),
)

if __name__ == "__main__":
    main()
