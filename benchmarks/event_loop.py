"""How long a large JSON body holds up the event loop: parsed on it, in a thread, and in a process of its own.

Example:
    python benchmarks/event_loop.py

Prints, for bodies of each size, the longest that a task which only wants to run every millisecond had to wait.
"""

import asyncio
import functools
import json
import statistics
import time
from collections.abc import Awaitable, Callable

import numpy as np

from shipshape.serving.encoding import Limits
from shipshape.serving.rest.json_process import JsonProcess
from shipshape.serving.rest.requests import parse_json

POINTS = (1_000, 4_000, 16_000, 65_536)
ROUNDS = 7
TICK_S, TIMEOUT_S = 1e-3, 120.0
LIMITS = Limits()


def main() -> None:
    """Print the table."""
    process = JsonProcess(LIMITS)
    try:
        asyncio.run(measure(process))
    finally:
        process.close()


async def measure(process: JsonProcess) -> None:
    """One line a size: median over the rounds of each round's longest delay, milliseconds."""
    loop = asyncio.get_running_loop()

    async def on_loop(body: bytes) -> None:
        parse_json(body, "", LIMITS)

    async def in_thread(body: bytes) -> None:
        await loop.run_in_executor(None, functools.partial(parse_json, body, "", LIMITS))

    async def in_process(body: bytes) -> None:
        await process.parse(parse_json, body, "", TIMEOUT_S)

    ways = {"nothing": idle, "on the loop": on_loop, "in a thread": in_thread, "in a process": in_process}
    await in_process(body_of(10))  # its start is not the question
    print("points     MiB" + "".join(f"{way:>15}" for way in ways) + "   ms, longest delay of the loop")
    for count in POINTS:
        body = body_of(count)
        delays = [
            statistics.median([await longest_delay(way, body) for _ in range(ROUNDS)]) for way in ways.values()
        ]
        print(f"{count:6d} {len(body) / 2**20:7.2f}" + "".join(f"{delay:15.1f}" for delay in delays))


async def idle(_: bytes) -> None:
    """What the machine itself adds."""
    await asyncio.sleep(0.05)


def body_of(count: int) -> bytes:
    """JSON of `count` points with all digits of float32."""
    points = np.random.default_rng(0).random((count, 3), np.float32) * 100
    return json.dumps({"points": points.astype(float).tolist()}).encode()


async def longest_delay(parse: Callable[[bytes], Awaitable[None]], body: bytes) -> float:
    """Milliseconds beyond a tick that a task waited while `body` was parsed."""
    longest = 0.0

    async def tick() -> None:
        nonlocal longest
        while True:
            start = time.perf_counter()
            await asyncio.sleep(TICK_S)
            longest = max(longest, time.perf_counter() - start - TICK_S)

    ticking = asyncio.create_task(tick())
    await asyncio.sleep(10 * TICK_S)
    await parse(body)
    await asyncio.sleep(2 * TICK_S)
    ticking.cancel()
    return longest * 1e3


if __name__ == "__main__":
    main()
