"""The same reading and the same recognition on many machines: Ray Data spreads them, nothing here schedules.

Needs the extra shipshape[ray]. Each machine sees inputs and bundle under the same paths.
"""

import logging
import pickle
import socket
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import ray
from ray.exceptions import RayError

from shipshape.batch.identity import code_digest
from shipshape.batch.method import Method
from shipshape.batch.reading import read
from shipshape.batch.recognition import Recogniser, answers_of, warm_up
from shipshape.batch.units import Chunk, Ending, Part, Source
from shipshape.bundle import load_bundle
from shipshape.errors import BundleError, SettingsError, ShipshapeError
from shipshape.pipeline import Pipeline

CONNECT_S = 10.0

Batch = dict[str, Any]  # of one row, whose column `item` holds a pickled value


@dataclass(frozen=True, slots=True)
class RayEngine:
    """A cluster of Ray."""

    bundle: str
    code: str
    folder: Path  # of the bundle

    @classmethod
    def start(cls, address: str, folder: Path) -> "RayEngine":
        """Connect to the cluster at an address, `local` starts one of this machine alone.

        Raises:
            SettingsError: None answers there.
            BundleError: The bundle cannot be used.
        """
        bundle = load_bundle(folder).digest
        try:
            _knock(address)
            ray.init(None if address == "local" else address, log_to_driver=False, logging_level=logging.WARNING)
        except (OSError, ValueError, RuntimeError) as error:
            raise SettingsError(f"expected a Ray cluster at {address}, got {type(error).__name__}") from error
        context = ray.data.DataContext.get_current()
        context.enable_progress_bars = False  # the run has its own
        return cls(bundle, code_digest(), folder.resolve())

    def run(self, sources: Iterable[Source], method: Method, done: Container[str]) -> Iterator[Part | Ending]:
        """As `Engine.run`, in any order.

        Raises:
            ShipshapeError: A worker failed.
        """
        rows = [_row(Source(source.path.resolve(), source.sha256, source.size)) for source in sources]
        if not rows:
            return
        cores = int(ray.cluster_resources()["CPU"])  # type: ignore[no-untyped-call]
        reader, worker = (method, done), (self.folder, method, self.bundle, self.code)
        chunks = ray.data.from_items(rows, override_num_blocks=len(rows)).map_batches(
            _Reader, fn_constructor_args=reader, batch_size=1, concurrency=(1, min(cores, len(rows))), num_cpus=0
        )
        items = chunks.map_batches(_Worker, fn_constructor_args=worker, batch_size=1, concurrency=(1, cores))
        try:
            for row in items.iter_rows():
                yield pickle.loads(row["item"])
        except RayError as error:
            cause = getattr(error, "cause", None)
            if isinstance(cause, ShipshapeError):
                raise cause from error
            raise ShipshapeError(
                f"expected every worker of the Ray cluster to answer, got {type(error).__name__}: run the same "
                "command again, it goes on where it was stopped"
            ) from error


def _knock(address: str) -> None:
    """Raises OSError when nobody listens at HOST:PORT: Ray itself would try for minutes."""
    host, _, port = address.rpartition(":")
    if port.isdecimal() and "/" not in host:
        socket.create_connection((host, int(port)), CONNECT_S).close()


class _Reader:
    """Source -> its chunks, each as soon as it is full."""

    def __init__(self, method: Method, done: Container[str]) -> None:
        self._method, self._done = method, done

    def __call__(self, batch: Batch) -> Iterator[Batch]:
        for item in batch["item"]:
            for chunk in read(pickle.loads(item), self._method, self._done):
                yield _batch(chunk)


class _Worker:
    """Chunk -> its part; the bundle is loaded once a worker."""

    def __init__(self, folder: Path, method: Method, bundle: str, code: str) -> None:
        pipeline = Pipeline(load_bundle(folder))
        found = (pipeline.bundle.digest, code_digest())
        if found != (bundle, code):
            raise BundleError(f"expected bundle and code {bundle[:12]} {code} on each machine, got {found}")
        warm_up(pipeline, method.options)
        self._recogniser = Recogniser(answers_of(pipeline, method.options), method, bundle, code)

    def __call__(self, batch: Batch) -> Batch:
        items = [pickle.loads(item) for item in batch["item"]]
        (item,) = items
        return _batch(self._recogniser(item) if isinstance(item, Chunk) else item)


def _row(value: object) -> Batch:
    return {"item": pickle.dumps(value)}


def _batch(value: object) -> Batch:
    return {"item": np.array([pickle.dumps(value)], object)}
