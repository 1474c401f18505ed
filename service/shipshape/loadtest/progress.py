"""One line on the terminal while requests are sent."""

from collections.abc import Iterator
from contextlib import contextmanager

from hdrh.histogram import HdrHistogram
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from shipshape.loadtest.latency import DIGITS, LONGEST_US
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.plan import Plan
from shipshape.loadtest.processes import Watch
from shipshape.loadtest.sending import Ending


class Counts:
    """What has ended so far."""

    def __init__(self) -> None:
        self.ended = self.refused = self.failed = 0
        self._answered = HdrHistogram(1, LONGEST_US, DIGITS)

    def add(self, endings: list[Ending]) -> None:
        """Count some more."""
        for ending in endings:
            self.ended += 1
            self.refused += ending.outcome == Outcome.REFUSED
            self.failed += ending.outcome > Outcome.REFUSED
            if ending.outcome <= Outcome.DEGRADED:
                self._answered.record_value(min(LONGEST_US, max(1, round(ending.seconds * 1e6))))

    def __str__(self) -> str:
        found = self._answered.get_percentile_to_value_dict([50, 99])
        p50, p99 = (found.get(percentile, 0) / 1e3 for percentile in (50, 99))
        return f"p50 {p50:.1f} ms  p99 {p99:.1f} ms  refused {self.refused}  failed {self.failed}"


class _CountsColumn(ProgressColumn):
    def render(self, task: Task) -> Text:
        """As any column of rich."""
        return Text(str(task.fields["counts"]))


@contextmanager
def progress_of(plan: Plan, title: str) -> Iterator[Watch | None]:
    """What to tell of endings, for as long as the block runs; None where nobody looks on."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed}/{task.total}"))
    counts = Counts()
    with Progress(*columns, _CountsColumn(), TimeRemainingColumn(), console=console, transient=True) as progress:
        task = progress.add_task(title, total=len(plan.due), counts=counts)

        def watch(endings: list[Ending]) -> None:
            """Move the line on by requests that have just ended."""
            counts.add(endings)
            progress.update(task, completed=counts.ended)

        yield watch
