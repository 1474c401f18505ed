"""One line on the terminal while a run goes on: bytes read, contacts, how fast or what is hashed, time left."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from shipshape.batch.inputs import Inputs
from shipshape.batch.units import Ending, Part


class Watch:
    """How far a run is, in bytes of its inputs; what was done before counts as done."""

    def __init__(self, inputs: Inputs) -> None:
        self._inputs = inputs
        self._shares: dict[str, float] = {}
        self._started = time.monotonic()
        self.contacts = 0

    @property
    def done(self) -> float:
        """Bytes of the inputs whose contacts are in the results."""
        read = sum(self._inputs.of(sha256).size * share for sha256, share in self._shares.items())
        return read + sum(record.size for record in self._inputs.records if record.same_as or record.error)

    def add(self, item: Part | Ending) -> None:
        """A part was written, or an input ended."""
        if isinstance(item, Part):
            self.contacts += item.rows
            self._shares[item.sha256] = max(item.share, self._shares.get(item.sha256, 0.0))
        elif not item.error:
            self._shares[item.sha256] = 1.0

    def __str__(self) -> str:
        if self._inputs.hashing:
            return f"{self.contacts} contacts, hashing {self._inputs.hashing}"
        rate = self.contacts / max(time.monotonic() - self._started, 1e-3)
        return f"{self.contacts} contacts  {rate:.0f}/s"


class _WatchColumn(ProgressColumn):
    def render(self, task: Task) -> Text:
        """As any column of rich."""
        return Text(str(task.fields["watch"]))


@contextmanager
def progress_of(inputs: Inputs) -> Iterator[Callable[[Part | Ending], None]]:
    """What to tell of parts and endings; shown for as long as the block runs, where somebody looks on."""
    watch = Watch(inputs)
    console = Console(stderr=True)
    if not console.is_terminal:
        yield watch.add
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(*columns, _WatchColumn(), TimeRemainingColumn(), console=console, transient=True) as progress:
        task = progress.add_task("batch", total=max(inputs.size, 1), watch=watch)

        def add(item: Part | Ending) -> None:
            """Count, and move the bar on."""
            watch.add(item)
            progress.update(task, completed=watch.done)

        yield add
