"""The pictures of a report: SVG whose colours are the page's, light or dark."""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

from shipshape.loadtest.budget import Verdict
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.report import Step
from shipshape.loadtest.summary import Summary

# Each stands in the SVG for a variable of the page's style sheet.
INK, GRID, LIMIT, FIRST, SECOND = "#010101", "#020202", "#030303", "#040404", "#050505"
VARIABLES: Mapping[str, str] = {INK: "ink", GRID: "grid", LIMIT: "limit", FIRST: "first", SECOND: "second"}
OUTCOMES: Mapping[str, str] = {outcome.label: f"#1010{outcome:02x}" for outcome in Outcome}
STYLE: Mapping[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "shipshape",
    "font.size": 11,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": GRID,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
}
WIDTH, HEIGHT = 7.2, 3.2  # inches


def percentiles(run: Summary) -> str:
    """Latency over percentile, the axis of which gives each nine the same room."""

    def draw(axes: Axes) -> None:
        """Latency over the share of answers, as high dynamic range histograms are drawn."""
        curves = (("since due", run.latency.curve, FIRST), ("since sent", run.service.curve, SECOND))
        for name, curve, colour in curves:
            if curve:
                at, milliseconds = np.array(curve).T
                axes.plot(100 / (100 - at), milliseconds, color=colour, label=name, lw=2)
        _limit(axes, run)
        axes.set_xscale("log")
        nines = [0.0, 90.0, 99.0, 99.9, 99.99, 99.999]
        axes.xaxis.set_major_locator(FixedLocator([100 / (100 - nine) for nine in nines]))
        axes.xaxis.set_major_formatter(FixedFormatter([f"{nine:g} %" for nine in nines]))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set(xlabel="of the answers", ylabel="ms or less", ylim=(0, None))

    return _svg(draw, "Latency at each percentile")


def latency_over_time(run: Summary) -> str:
    """Median and 99th percentile of each part of the run."""

    def draw(axes: Axes) -> None:
        """Two percentiles over time, with gaps where nothing was answered."""
        middle = [part.start_s + part.seconds / 2 for part in run.timeline]
        for name, colour in (("p99", FIRST), ("p50", SECOND)):
            values = [getattr(part, name) for part in run.timeline]
            times = np.array([np.nan if value is None else value for value in values])
            axes.plot(middle, times, color=colour, label=name, lw=2, marker="o", ms=3)
        _limit(axes, run)
        axes.set(xlabel="s, when due", ylabel="ms since due", ylim=(0, None))

    return _svg(draw, "Latency over time")


def outcomes_over_time(run: Summary) -> str:
    """Requests a second by how they ended."""

    def draw(axes: Axes) -> None:
        """Outcomes a second, one on top of the other."""
        names = [name for name, count in run.outcomes.items() if count]
        edges = [part.start_s for part in run.timeline]
        widths = [part.seconds for part in run.timeline]
        below = np.zeros(len(edges))
        for name in names:
            height = np.array([part.outcomes[name] / part.seconds for part in run.timeline])
            axes.bar(edges, height, widths, below, color=OUTCOMES[name], label=name, align="edge", lw=0)
            below += height
        axes.set(xlabel="s, when due", ylabel="requests/s")

    return _svg(draw, "Outcomes over time")


def sweep_curve(steps: Sequence[Step]) -> str:
    """Goodput at each rate that was tried; where it leaves the diagonal, the target no longer keeps up."""

    def draw(axes: Axes) -> None:
        """What was answered in time over what was asked, one point a step."""
        ordered = sorted(steps, key=lambda step: step.rate)
        rates = [step.rate for step in ordered]
        axes.plot([0, max(rates)], [0, max(rates)], color=GRID, lw=1.5)
        axes.plot(rates, [step.summary.goodput for step in ordered], color=SECOND, lw=1.5)
        for verdict, colour in zip(Verdict, (FIRST, LIMIT, GRID), strict=True):
            some = [step for step in ordered if step.summary.verdict is verdict]
            if some:
                goodput = [step.summary.goodput for step in some]
                axes.scatter([step.rate for step in some], goodput, color=colour, label=verdict, zorder=3, s=36)
        axes.set(xlabel="offered contacts/s", ylabel="in time, contacts/s", xlim=(0, None), ylim=(0, None))

    return _svg(draw, "Goodput at each rate")


def _limit(axes: Axes, run: Summary) -> None:
    limit_ms = run.budget.limit_s * 1e3
    axes.axhline(limit_ms, color=LIMIT, lw=1.2, ls="--", label=f"budget, {limit_ms:g} ms")


def _svg(draw: Callable[[Axes], None], title: str) -> str:
    """The picture as an element of an HTML page, named for those who cannot see it."""
    with mpl.rc_context(dict(STYLE)):
        figure = Figure((WIDTH, HEIGHT), layout="constrained")
        axes = figure.subplots()
        draw(axes)
        axes.legend(loc="lower left", ncols=len(Outcome), bbox_to_anchor=(0, 1), borderaxespad=0.2)
        file = io.StringIO()
        figure.savefig(file, format="svg", transparent=True, metadata={"Date": None, "Title": title})
    svg = file.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r' width="[^"]+pt"', "", re.sub(r' height="[^"]+pt"', "", svg, count=1), count=1)
    colours = {**VARIABLES, **{colour: name for name, colour in OUTCOMES.items()}}
    return re.sub("|".join(colours), lambda match: f"var(--{colours[match[0]]})", svg)
