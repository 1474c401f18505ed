"""Where the service is in its life, and what follows for probes: started, live and ready are three things.

starting --all doors listen--> warming --every stage is warm--> ready --signal--> stopping
                                                                | ^
                                                          drain v | resume
                                                              drained

started  the doors listen
live     and no worker has died: while it holds, a new process would be no better
ready    in the state `ready`, with no worker stuck: send requests here. In `drained`, and in `stopping` until the
         linger is over, those that come are still answered
"""

import threading
from collections.abc import Callable
from enum import StrEnum
from typing import Protocol


class State(StrEnum):
    """Of a service; see above. Broken: a worker has died, or is stuck in a stage."""

    STARTING = "starting"
    WARMING = "warming"
    READY = "ready"
    DRAINED = "drained"
    BROKEN = "broken"
    STOPPING = "stopping"


class Workers(Protocol):
    """Who computes."""

    @property
    def alive(self) -> bool:
        """Whether none of them has died."""
        ...

    @property
    def sound(self) -> bool:
        """Whether all of them live and none is stuck in a stage."""
        ...


Tell = Callable[[bool, bool], None]  # live, ready


class Health:
    """Asked by probes, and tells `watch`ers of every change.

    Args:
        workers: Asked whenever somebody asks: nobody can be told by a thread that died.
    """

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._phase = State.STARTING
        self._drained = False
        self._watchers: list[Tell] = []
        self._told: tuple[bool, bool] | None = None
        self._telling = threading.Lock()  # or a later change could be told before an earlier one

    @property
    def state(self) -> State:
        """What an operator is told."""
        if self._phase in (State.STARTING, State.STOPPING):
            return self._phase
        if not self._workers.sound:
            return State.BROKEN
        return State.DRAINED if self._drained and self._phase is State.READY else self._phase

    @property
    def leaving(self) -> bool:
        """Whether callers should go elsewhere: drained or stopping. Cheap: asked with every answer."""
        return self._phase is State.STOPPING or (self._drained and self._phase is State.READY)

    @property
    def started(self) -> bool:
        """Whether all doors listen."""
        return self._phase is not State.STARTING

    @property
    def live(self) -> bool:
        """Whether the process is worth keeping."""
        return self.started and self._workers.alive

    @property
    def ready(self) -> bool:
        """Whether requests should be sent here."""
        return self.state is State.READY

    def watch(self, tell: Tell) -> None:
        """Call `tell` with live and ready, now and whenever one of them has changed."""
        self._watchers.append(tell)
        tell(self.live, self.ready)

    def refresh(self) -> None:
        """Tell the watchers if something has changed; called often, for the death of a worker tells nobody."""
        with self._telling:
            found = self.live, self.ready
            if found != self._told:
                self._told = found
                for tell in self._watchers:
                    tell(*found)

    def move_to(self, phase: State) -> None:
        """The next of `starting`, `warming`, `ready` and `stopping` has come."""
        self._phase = phase
        self.refresh()

    def drain(self) -> None:
        """Not ready until `resume`."""
        self._drained = True
        self.refresh()

    def resume(self) -> None:
        """Ready again, if nothing else stands against it."""
        self._drained = False
        self.refresh()
