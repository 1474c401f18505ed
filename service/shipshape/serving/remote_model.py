"""A model that computes in worker processes; the service itself holds neither networks nor compiled loops."""

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from shipshape.bundle import read_bundle
from shipshape.executor import Ended, Executor, ProcessCrew, Task
from shipshape.serving.description import Description
from shipshape.serving.model import Order, Reply
from shipshape.serving.order_wire import to_wire
from shipshape.types import Options, Preset, Rung

C = TypeVar("C")
PREPARE = "shipshape.serving.prepare:prepare"  # by name: it imports what the service itself need not hold


@dataclass(frozen=True, slots=True)
class RemoteStage:
    """A stage that runs elsewhere."""

    name: str

    def run(self, work: Any) -> NoReturn:
        """Not here."""
        raise NotImplementedError(f"stage {self.name} runs in a worker process")


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)  # the executor learns the cost of each object
class RemoteRung:
    """A rung whose stages run elsewhere, all in one go as far as the service knows."""

    name: Rung
    stages: tuple[RemoteStage, ...] = ()


class RemotePipeline:
    """Stages and ladders as the worker processes described them."""

    def __init__(self, description: Description) -> None:
        self.stages = [RemoteStage(name) for name in description.stages]
        self.costs = [(RemoteRung(name), seconds) for _, name, seconds in description.rungs]
        presets = [preset for preset, _, _ in description.rungs]
        rungs = [(preset, rung) for preset, (rung, _) in zip(presets, self.costs, strict=True)]
        self._ladders = {
            (preset, lowest): [
                rung for other, rung in rungs if other is preset and Options(lowest_rung=lowest).accepts(rung.name)
            ]
            for preset in Preset
            for lowest in Rung
        }

    def ladder(self, options: Options) -> Sequence[RemoteRung]:
        """The rungs that the caller accepts, the best first."""
        return self._ladders[options.preset, options.lowest_rung]


class RemoteModel:
    """Its processes have the bundle when it is made; `start` has them try it out.

    Args:
        folder: Of the bundle.
        max_points: Of one contact.
        log_level: Of the processes.

    Raises:
        BundleError: It cannot be used; what shows only in an answer is found by `start`.
        NotReady: A process ended before it had read it.
    """

    def __init__(self, folder: Path, max_points: int, log_level: str) -> None:
        self.bundle = read_bundle(folder)
        self.pipeline: RemotePipeline
        self._crew = ProcessCrew(PREPARE, folder, self.bundle.digest, max_points, log_level)
        try:
            self._crew.loaded()
        except BaseException:
            self._crew.close()
            raise

    def task(self, order: Order[C], deadline: float) -> Task[Any, Reply[C]]:
        """As `Model.task`; what is wrong with the points is found by the worker."""
        return Task(
            self.pipeline.ladder(order.wishes.options),
            to_wire(order),
            self._not_here,
            deadline,
            order.wishes.lane,
            size=len(order.contact.points_level),
            crew=self._crew,
        )

    def start(self, executor: Executor, stopping: Callable[[], bool]) -> None:
        """As `Model.start`; the processes have tried the bundle out before they say that they are prepared."""
        try:
            description: Description = self._crew.prepared(stopping)
            self.pipeline = RemotePipeline(description)
            executor.learn(self.pipeline.costs, description.size)
            self._crew.start(executor, executor.workers)
        except BaseException:
            self._crew.close()
            raise
        executor.join(self._crew)
        # When it was replaced, and the last request that began with it has its answer, nobody knows it any more.
        weakref.finalize(self, _end, executor, self._crew)

    def close(self) -> None:
        """It is not needed after all."""
        self._crew.close()

    def _not_here(self, work: Any, ended: Ended) -> NoReturn:  # of the model, which so lives as long as its tasks
        raise NotImplementedError("answers are made in a worker process")


def _end(executor: Executor, crew: ProcessCrew) -> None:
    executor.leave(crew)
    crew.close()
