"""The load generator: a process of its own that asks over loopback, in a closed or an open loop."""

import asyncio
import itertools
import re
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass

import grpc
import numpy as np
import uvloop

from benchmarks.serving.wires import Wire

HOST = "127.0.0.1"
STATUS = {  # of gRPC, as HTTP
    grpc.StatusCode.RESOURCE_EXHAUSTED: 429,
    grpc.StatusCode.DEADLINE_EXCEEDED: 504,
    grpc.StatusCode.UNAVAILABLE: 503,
}
LOST = 0  # the connection broke
SPIN_S = 0.002  # before an arrival: timers are a millisecond late
Reply = tuple[int, bytes]
Ask = Callable[[bytes], Awaitable[Reply]]
_loop = asyncio.Runner(loop_factory=uvloop.new_event_loop)  # one for all calls: gRPC keeps to its first


@dataclass(frozen=True, slots=True)
class Load:
    """What came of a load.

    Attributes:
        contacts: Answered with 200.
        seconds: From the first request to the last answer.
        statuses: Requests by status.
        latency_ms: Of each 200; open loop: from when it was scheduled.
        refused_ms: Of each 429, from when it was sent.
        lag_ms: Open loop: 99th percentile of how late requests were sent.
    """

    contacts: int
    seconds: float
    statuses: dict[int, int]
    latency_ms: np.ndarray
    refused_ms: np.ndarray
    lag_ms: float = 0.0


def probe(wire: Wire, port: int, seconds: float) -> list[bytes] | None:
    """An answer to each request, or None if the server does not answer them all within `seconds`."""
    return _loop.run(_probe(wire, port + wire.port, seconds))


def closed(wire: Wire, port: int, seconds: float) -> Load:
    """Every connection asks again as soon as it was answered."""
    return _loop.run(_closed(wire, port + wire.port, seconds))


def open_loop(wire: Wire, port: int, seconds: float, rate: float, seed: int) -> Load:
    """Requests at Poisson times, `rate` a second, however the server does."""
    times = np.cumsum(np.random.default_rng(seed).exponential(1 / rate, max(1, int(rate * seconds))))
    return _loop.run(_open(wire, port + wire.port, times))


async def _probe(wire: Wire, port: int, seconds: float) -> list[bytes] | None:
    with suppress(OSError, EOFError, TimeoutError):
        async with asyncio.timeout(seconds), AsyncExitStack() as stack:
            ask = await _connect(wire, port, stack)
            replies = [await ask(request) for request in wire.requests]
            if all(status == 200 for status, _ in replies):
                return [body for _, body in replies]
    return None


async def _closed(wire: Wire, port: int, seconds: float) -> Load:
    log = _Log()
    async with AsyncExitStack() as stack:
        asks = [await _connect(wire, port, stack) for _ in range(wire.connections)]
        started = time.perf_counter()
        await asyncio.gather(
            *(_again(ask, wire, offset, started + seconds, log) for offset, ask in enumerate(asks))
        )
        return log.load(wire, time.perf_counter() - started)


async def _again(ask: Ask, wire: Wire, offset: int, end: float, log: "_Log") -> None:
    for turn in itertools.count(offset):
        sent = time.perf_counter()
        if sent >= end:
            return
        status, _ = await ask(wire.requests[turn % len(wire.requests)])
        log.note(status, sent, sent)
        if status == LOST:
            return


async def _open(wire: Wire, port: int, times: np.ndarray) -> Load:
    log, idle, limit = _Log(), [], asyncio.Semaphore(wire.most)
    async with AsyncExitStack() as stack:
        idle += [await _connect(wire, port, stack) for _ in range(wire.connections)]

        async def send(request: bytes, scheduled: float) -> None:
            async with limit:
                ask = idle.pop() if idle else await _connect(wire, port, stack)
                sent = time.perf_counter()
                status, _ = await ask(request)
                log.note(status, scheduled, sent)
                if status != LOST:
                    idle.append(ask)

        started = time.perf_counter()
        async with asyncio.TaskGroup() as tasks:
            for turn, scheduled in enumerate(started + times):
                await _until(scheduled)
                tasks.create_task(send(wire.requests[turn % len(wire.requests)], scheduled))
        return log.load(wire, time.perf_counter() - started)


async def _until(moment: float) -> None:
    while (left := moment - time.perf_counter()) > 0:
        await asyncio.sleep(max(0.0, left - SPIN_S))


class _Log:
    def __init__(self) -> None:
        self.statuses: Counter[int] = Counter()
        self.answered, self.refused, self.lags = [], [], []

    def note(self, status: int, scheduled: float, sent: float) -> None:
        now = time.perf_counter()
        self.statuses[status] += 1
        self.lags.append(sent - scheduled)
        if status == 200:
            self.answered.append(now - scheduled)
        elif status == 429:
            self.refused.append(now - sent)

    def load(self, wire: Wire, seconds: float) -> Load:
        latency, refused, lags = (np.array(times) * 1e3 for times in (self.answered, self.refused, self.lags))
        lag = float(np.percentile(lags, 99)) if len(lags) else 0.0
        return Load(len(latency) * wire.contacts, seconds, dict(self.statuses), latency, refused, lag)


async def _connect(wire: Wire, port: int, stack: AsyncExitStack) -> Ask:
    if wire.kind == "http":
        return await _http(port, stack)
    options = [("grpc.use_local_subchannel_pool", 1), ("grpc.enable_http_proxy", 0)]
    channel = await stack.enter_async_context(grpc.aio.insecure_channel(f"{HOST}:{port}", options))
    return _unary(channel, wire.method) if wire.kind == "unary" else _stream(channel, wire.method)


async def _http(port: int, stack: AsyncExitStack) -> Ask:
    reader, writer = await asyncio.open_connection(HOST, port)
    stack.callback(writer.close)

    async def ask(request: bytes) -> Reply:
        try:
            writer.write(request)
            head = await reader.readuntil(b"\r\n\r\n")
            return int(head[9:12]), await _body(reader, head)
        except (EOFError, OSError):
            return LOST, b""

    return ask


async def _body(reader: asyncio.StreamReader, head: bytes) -> bytes:
    length = re.search(rb"(?i)\r\ncontent-length: *(\d+)", head)
    if length:
        return await reader.readexactly(int(length[1]))
    chunks = []
    while size := int(await reader.readline(), 16):
        chunks.append((await reader.readexactly(size + 2))[:-2])
    await reader.readexactly(2)
    return b"".join(chunks)


def _unary(channel: grpc.aio.Channel, method: str) -> Ask:
    call = channel.unary_unary(method)

    async def ask(request: bytes) -> Reply:
        try:
            return 200, await call(request)
        except grpc.aio.AioRpcError as error:
            return STATUS.get(error.code(), 500), b""

    return ask


def _stream(channel: grpc.aio.Channel, method: str) -> Ask:
    call = channel.stream_stream(method)()

    async def ask(request: bytes) -> Reply:
        try:
            await call.write(request)
            body = await call.read()
            return (LOST, b"") if body is grpc.aio.EOF else (200, body)
        except (grpc.aio.AioRpcError, asyncio.InvalidStateError):  # the whole call ended
            return LOST, b""

    return ask
