"""Plots as SVG whose colours are the page's, light or dark."""

import io
import re
from collections.abc import Callable, Mapping
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Each stands in the SVG for a variable of the page's style sheet.
INK, GRID, LIMIT, FIRST, SECOND = "#010101", "#020202", "#030303", "#040404", "#050505"
VARIABLES: Mapping[str, str] = {INK: "ink", GRID: "grid", LIMIT: "limit", FIRST: "first", SECOND: "second"}
STYLE: Mapping[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "shipshape",
    "font.size": 11,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": GRID,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
}
WIDTH, HEIGHT = 7.2, 3.2  # inches
LEGEND_COLUMNS = 8


def to_svg(draw: Callable[[Axes], None], title: str, colours: Mapping[str, str] | None = None) -> str:
    """A plot as an element of an HTML page, named for those who cannot see it.

    Args:
        draw: Draws into the axes, in the colours of this module or of `colours`.
        title: What is seen.
        colours: More colours that stand for variables of the page's style sheet, and their names.
    """
    with mpl.rc_context(dict(STYLE)):
        figure = Figure((WIDTH, HEIGHT), layout="constrained")
        axes = figure.subplots()
        draw(axes)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="lower left", ncols=LEGEND_COLUMNS, bbox_to_anchor=(0, 1), borderaxespad=0.2)
        file = io.StringIO()
        figure.savefig(file, format="svg", transparent=True, metadata={"Date": None, "Title": title})
    svg = file.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r' width="[^"]+pt"', "", re.sub(r' height="[^"]+pt"', "", svg, count=1), count=1)
    names = {**VARIABLES, **(colours or {})}
    return re.sub("|".join(names), lambda match: f"var(--{names[match[0]]})", svg)
