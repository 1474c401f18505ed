"""The report as one HTML page that needs nothing else: no network, no other file."""

from shipshape.loadtest import plots
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.report import Report
from shipshape.loadtest.table import CLOCKS
from shipshape.pages import to_html


def to_page(report: Report) -> str:
    """The page; what a target said is shown as text, whatever it holds."""
    pictures = {
        "Latency at each percentile": plots.percentiles(report.run),
        "Latency over time": plots.latency_over_time(report.run),
        "Outcomes over time": plots.outcomes_over_time(report.run),
    }
    if report.sweep:
        pictures = {"Goodput at each rate": plots.sweep_curve(report.sweep), **pictures}
    values = {
        "report": report,
        "run": report.run,
        "clocks": {title: getattr(report.run, clock) for clock, title in CLOCKS.items()},
        "outcomes": [outcome.label for outcome in Outcome if report.run.outcomes[outcome.label]],
    }
    return to_html("shipshape.loadtest", values, pictures)
