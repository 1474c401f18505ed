"""The pictures of a report: SVG whose colours are the page's, light or dark."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

from shipshape.loadtest.budget import Verdict
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.report import Step
from shipshape.loadtest.summary import Summary
from shipshape.pages.svg import FIRST, GRID, LIMIT, SECOND, to_svg

OUTCOMES: Mapping[str, str] = {outcome.label: f"#1010{outcome:02x}" for outcome in Outcome}
COLOURS: Mapping[str, str] = {colour: name for name, colour in OUTCOMES.items()}


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

    return to_svg(draw, "Latency at each percentile", COLOURS)


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

    return to_svg(draw, "Latency over time", COLOURS)


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

    return to_svg(draw, "Outcomes over time", COLOURS)


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

    return to_svg(draw, "Goodput at each rate", COLOURS)


def _limit(axes: Axes, run: Summary) -> None:
    limit_ms = run.budget.limit_s * 1e3
    axes.axhline(limit_ms, color=LIMIT, lw=1.2, ls="--", label=f"budget, {limit_ms:g} ms")
