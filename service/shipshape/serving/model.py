"""A bundle and what computes with it in this process: an order for one contact becomes a task of the executor."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from shipshape.bundle import Bundle
from shipshape.executor import Executor, Stage, Task
from shipshape.serving.encoding import Wishes
from shipshape.types import Contact, Options, Recognition, Rung

C = TypeVar("C")
Render = Callable[[Contact, Recognition], bytes]  # -> PNG


@dataclass(frozen=True, slots=True)
class Answer:
    """One contact's recognition and, if wished, its picture (PNG)."""

    contact: Contact
    recognition: Recognition
    png: bytes | None = None


@dataclass(frozen=True, slots=True)
class Reply(Generic[C]):
    """What a door is given of an answer: what its own encoder made of it, and what all doors tell."""

    content: C
    rung: Rung
    stage_ms: Mapping[str, float]

    def __reduce__(self) -> tuple[Any, ...]:
        """One comes with every contact, and dataclasses with slots, as enumerations, are slow to pickle."""
        return _reply, (self.content, self.rung.value, self.stage_ms)


def _reply(content: Any, rung: str, stage_ms: Mapping[str, float]) -> Reply[Any]:
    return Reply(content, Rung(rung), stage_ms)


Encode = Callable[[Answer, Wishes], C]  # a function of a module, so that it can be named to a worker process


def unencoded(answer: Answer, _: Wishes) -> Answer:
    """The encoder of a door that wants the answer itself."""
    return answer


@dataclass(frozen=True, slots=True)
class Order(Generic[C]):
    """One contact to be computed, and how its answer is to be encoded; all of it can travel to another process."""

    contact: Contact
    wishes: Wishes
    encode: Encode[C]


# All of them are checkable at run time so that shape-checked tests can check them.
@runtime_checkable
class LadderRung(Protocol):
    """One rung of a pipeline's ladder and its stages."""

    @property
    def name(self) -> Rung:
        """As answers tell it."""
        ...

    @property
    def stages(self) -> Sequence[Stage[Any]]:
        """In their order."""
        ...


@runtime_checkable
class Ladders(Protocol):
    """What is known of a pipeline wherever it runs."""

    @property
    def stages(self) -> Sequence[Stage[Any]]:
        """In the order of the data path."""
        ...

    def ladder(self, options: Options) -> Sequence[LadderRung]:
        """The rungs that the caller accepts, the best first."""
        ...


@runtime_checkable
class PipelineLike(Ladders, Protocol):
    """What a model needs of a pipeline; `Any` is its work item, which only its own stages read."""

    def begin(self, contact: Contact, options: Options) -> Any:
        """The work item; raises InvalidInput when the points cannot be one vessel's cluster."""
        ...

    def finish(self, work: Any, stage_ms: Mapping[str, float], rung: Rung, rung_reason: str) -> Recognition:
        """The answer, once every stage of the rung ran."""
        ...


@runtime_checkable
class Model(Protocol):
    """A bundle and what computes with it; replaced as one."""

    @property
    def bundle(self) -> Bundle:
        """What was learnt."""
        ...

    @property
    def pipeline(self) -> Ladders:
        """Its stages and rungs."""
        ...

    def task(self, order: Order[C], deadline: float) -> Task[Any, Reply[C]]:
        """What the executor is given; raises InvalidInput for points that cannot be one vessel's cluster."""
        ...

    def start(self, executor: Executor, stopping: Callable[[], bool]) -> None:
        """Try it out and let the executor know what it costs, so that no caller pays for the first time.

        Raises:
            Cancelled: `stopping` said so.
            BundleError: A number of an answer is not finite.
            Exception: Whatever a stage raises.
        """
        ...

    def close(self) -> None:
        """Nobody will ask it any more."""
        ...
