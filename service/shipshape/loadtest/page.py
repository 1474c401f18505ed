"""The report as one HTML page that needs nothing else: no network, no other file."""

from importlib.resources import files

import jinja2
from markupsafe import Markup

from shipshape.loadtest import plots
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.report import Report
from shipshape.loadtest.table import CLOCKS


def to_page(report: Report) -> str:
    """The page; what a target said is shown as text, whatever it holds."""
    pictures = {
        "Latency at each percentile": plots.percentiles(report.run),
        "Latency over time": plots.latency_over_time(report.run),
        "Outcomes over time": plots.outcomes_over_time(report.run),
    }
    if report.sweep:
        pictures = {"Goodput at each rate": plots.sweep_curve(report.sweep), **pictures}
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    environment.filters["ms"] = _ms
    environment.filters["percent"] = lambda share: f"{share:.2%}"
    template = environment.from_string(
        files("shipshape.loadtest").joinpath("page.html").read_text(encoding="utf-8")
    )
    return template.render(
        report=report,
        run=report.run,
        pictures={title: Markup(svg) for title, svg in pictures.items()},
        clocks={title: getattr(report.run, clock) for clock, title in CLOCKS.items()},
        outcomes=[outcome.label for outcome in Outcome if report.run.outcomes[outcome.label]],
    )


def _ms(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}" if value < 100 else f"{value:.0f}"
