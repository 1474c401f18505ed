"""The limit: the bare pipeline in process, on the server's cores, a process a core."""

import os
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from types import TracebackType

import cv2

from benchmarks.serving.contacts import contacts
from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.types import Contact


@dataclass(frozen=True, slots=True)
class Bare:
    """What the bare pipeline took."""

    contacts: int
    seconds: float
    cpu_s: float


class Limit:
    """Processes that stay for the whole run, asleep until they are asked.

    Args:
        cores: One process each.
        seed: Of the contacts.
    """

    def __init__(self, cores: tuple[int, ...], seed: int) -> None:
        self._seed = seed
        self._stack = ExitStack()
        self._pools = [self._stack.enter_context(pinned((core,))) for core in cores]

    def __enter__(self) -> "Limit":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self._stack.close()

    def vessels(self) -> list[str]:
        """What every server must answer."""
        return self._pools[0].submit(_vessels, self._seed).result()

    def run(self, seconds: float) -> Bare:
        """All cores at once."""
        runs = [pool.submit(_run, self._seed, seconds) for pool in self._pools]
        found = [run.result() for run in runs]
        return Bare(
            sum(bare.contacts for bare in found),
            max(bare.seconds for bare in found),
            sum(bare.cpu_s for bare in found),
        )


def pinned(cores: tuple[int, ...]) -> ProcessPoolExecutor:
    """One fresh process that stays on `cores`."""
    return ProcessPoolExecutor(
        1, mp_context=get_context("spawn"), initializer=os.sched_setaffinity, initargs=(0, cores)
    )


@cache
def _ready(seed: int) -> tuple[Pipeline, list[Contact]]:
    cv2.setNumThreads(1)
    pipeline, asked = Pipeline(load_bundle(Path("models"))), [Contact(points) for points in contacts(seed)]
    for contact in asked:
        pipeline.run(contact)
    return pipeline, asked


def _vessels(seed: int) -> list[str]:
    pipeline, asked = _ready(seed)
    return [pipeline.run(contact).vessel for contact in asked]


def _run(seed: int, seconds: float) -> Bare:
    pipeline, asked = _ready(seed)
    started, busy, done = time.perf_counter(), time.process_time(), 0
    while (took := time.perf_counter() - started) < seconds:
        pipeline.run(asked[done % len(asked)])
        done += 1
    return Bare(done, took, time.process_time() - busy)
