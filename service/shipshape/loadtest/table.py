"""What was found, for a terminal or a log."""

from rich.console import Console
from rich.table import Table

from shipshape.loadtest.latency import Latency
from shipshape.loadtest.report import Report, Step
from shipshape.loadtest.summary import Summary

WIDTH = 100  # of a line that goes into a file
CLOCKS = {
    "latency": "answer - due",
    "service": "answer - sent",
    "refusal": "refusal - sent",
    "lag": "sent - due (the tool)",
}


def print_step(step: Step) -> None:
    """One line on one rate of a sweep."""
    run = step.summary
    p99 = run.latency.percentiles["p99"]
    shown = "-" if p99 is None else f"{p99:.1f} ms"
    _console().print(
        f"{step.rate:8.1f} contacts/s  {run.verdict:14} in time {run.in_budget / run.requests:7.2%}  p99 {shown}",
        highlight=False,
    )


def print_report(report: Report) -> None:
    """The tables of a report, and its verdict last."""
    console = _console()
    console.print(_rates(report.run))
    console.print(_times(report.run))
    if len(report.run.groups) > 1:
        console.print(_groups(report.run))
    for complaint in report.run.complaints:
        console.print(f"  {complaint}", markup=False, highlight=False)
    console.print(report.sentence, markup=False, highlight=False, soft_wrap=True)


def _rates(run: Summary) -> Table:
    table = Table("requests", "", box=None, pad_edge=False)
    table.add_row("due", f"{run.requests} in {run.seconds:.1f} s, after {run.warmup_requests} to warm up")
    for label, count in run.outcomes.items():
        if count or label == "ok":
            table.add_row(label, f"{count} ({count / run.requests:.2%})")
    table.add_row(
        "contacts/s", f"offered {run.offered:.1f}, answered {run.throughput:.1f}, in time {run.goodput:.1f}"
    )
    return table


def _times(run: Summary) -> Table:
    names = list(run.latency.percentiles)
    table = Table("milliseconds", "count", *names, "max", box=None, pad_edge=False)
    for clock, title in CLOCKS.items():
        latency: Latency = getattr(run, clock)
        table.add_row(title, str(latency.count), *map(_ms, latency.percentiles.values()), _ms(latency.max))
    return table


def _groups(run: Summary) -> Table:
    table = Table("group", "requests", "in time", "p50", "p99", box=None, pad_edge=False)
    for group in run.groups:
        share = f"{group.in_budget / group.requests:.2%}" if group.requests else "-"
        times = (_ms(group.latency.percentiles[name]) for name in ("p50", "p99"))
        table.add_row(group.name, str(group.requests), share, *times)
    return table


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _console() -> Console:
    console = Console()
    return console if console.is_terminal else Console(width=WIDTH)
