"""Where chunks become parts: in processes here, in a running service, or on a cluster of Ray; the same rows."""

from collections.abc import Container, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from shipshape.batch.identity import code_digest
from shipshape.batch.method import Method
from shipshape.batch.processes import AHEAD, fork_workers, run_ahead, run_in_processes
from shipshape.batch.reading import read
from shipshape.batch.recognition import Recogniser, answers_of, warm_up
from shipshape.batch.service import Service
from shipshape.batch.units import Ending, Part, Source
from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline

CALLS = 4  # of a service under way at a time


class Engine(Protocol):
    """Computes the parts of sources."""

    @property
    def bundle(self) -> str:
        """Digest of the bundle that it computes with."""
        ...

    @property
    def code(self) -> str:
        """Version and digest of the code that it computes with."""
        ...

    def run(self, sources: Iterable[Source], method: Method, done: Container[str]) -> Iterator[Part | Ending]:
        """The parts that are not done, and after those of each source its ending."""
        ...


@dataclass(frozen=True, slots=True)
class LocalEngine:
    """Processes on this machine."""

    bundle: str
    code: str
    executor: Executor
    workers: int

    @classmethod
    def start(cls, folder: Path, method: Method, workers: int) -> "LocalEngine":
        """Load the bundle and fork the workers; no thread may have been started before."""
        pipeline = Pipeline(load_bundle(folder))
        warm_up(pipeline, method.options)
        bundle, code = pipeline.bundle.digest, code_digest()
        recogniser = Recogniser(answers_of(pipeline, method.options), method, bundle, code)
        return cls(bundle, code, fork_workers(recogniser, workers), workers)

    def run(self, sources: Iterable[Source], method: Method, done: Container[str]) -> Iterator[Part | Ending]:
        """As `Engine.run`."""
        chunks = (chunk for source in sources for chunk in read(source, method, done))
        return run_in_processes(self.executor, self.workers, chunks)


@dataclass(frozen=True, slots=True)
class ServiceEngine:
    """A running service, asked in its batch lane."""

    service: Service

    @property
    def bundle(self) -> str:
        """As `Engine.bundle`; the service refuses what it would answer with another one."""
        return self.service.bundle

    @property
    def code(self) -> str:
        """As `Engine.code`: a service tells its version alone."""
        return f"{self.service.version} of a service"

    def run(self, sources: Iterable[Source], method: Method, done: Container[str]) -> Iterator[Part | Ending]:
        """As `Engine.run`."""
        answers = self.service.answers_of(method.options, restored=method.restored)
        recogniser = Recogniser(answers, method, self.bundle, self.code)
        chunks = (chunk for source in sources for chunk in read(source, method, done))
        return run_ahead(ThreadPoolExecutor(CALLS), recogniser, chunks, AHEAD * CALLS)
