"""A model that computes in this process: in threads of the service, or in a worker process."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, TypeVar

from shipshape.bundle import Bundle
from shipshape.executor import Ended, Executor, Task
from shipshape.sample import sample_contact
from shipshape.serving.encoding import Wishes
from shipshape.serving.model import Answer, Encode, Order, PipelineLike, Render, Reply, unencoded
from shipshape.serving.warmup import warm_up
from shipshape.types import Options, Rung

C = TypeVar("C")


@dataclass(frozen=True, slots=True)
class LocalModel:
    """A bundle, the pipeline made of it, and what draws the pictures of its answers."""

    bundle: Bundle
    pipeline: PipelineLike
    render: Render

    def task(self, order: Order[C], deadline: float) -> Task[Any, Reply[C]]:
        """As `Model.task`."""

        def finish(work: Any, ended: Ended) -> Reply[C]:
            """On the worker: drawing a picture takes as long as the recognition."""
            recognition = self.pipeline.finish(work, ended.stage_ms, Rung(ended.rung), ended.why)
            png = self.render(order.contact, recognition) if order.wishes.png else None
            content = order.encode(Answer(order.contact, recognition, png), order.wishes)
            return Reply(content, recognition.rung, ended.stage_ms)

        return Task(
            self.pipeline.ladder(order.wishes.options),
            self.pipeline.begin(order.contact, order.wishes.options),
            finish,
            deadline,
            order.wishes.lane,
            size=len(order.contact.points_level),
        )

    def start(self, executor: Executor, stopping: Callable[[], bool]) -> None:
        """As `Model.start`."""
        self.try_out(executor.rehearse, stopping, [unencoded])

    def try_out(
        self,
        rehearse: Callable[[Task[Any, Any]], Any],
        stopping: Callable[[], bool],
        encoders: Sequence[Encode[Any]],
    ) -> None:
        """Run whatever a request can ask for, then a contact on every rung and encoder through `rehearse`."""
        warm_up(self.pipeline, self.render, stopping)
        for rung, encode in product((*Rung, *Rung), encoders):  # the first time is not what later ones cost
            order = Order(sample_contact(), Wishes(Options(lowest_rung=rung)), encode)
            task = self.task(order, math.inf)
            rehearse(replace(task, ladder=task.ladder[-1:]))

    def close(self) -> None:
        """Nothing to end: it goes with the last one who knows it."""
