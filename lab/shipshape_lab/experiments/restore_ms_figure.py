"""Milliseconds of every system, on a scale on which one line is ten times the one before."""

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipshape_lab.experiments.numbers import Numbers

NAME = "restore_ms.png"
# Okabe and Ito's colours, as in the other figures.
_ROWS = {
    "best": ("best: projection, inpainting, lifting", "#0072B2"),
    "pcn_reduced": ("PCN, reduced", "#F0C77A"),
    "pcn": ("PCN", "#E69F00"),
    "pcn.gpu": ("PCN on the GPU", "#E69F00"),
    "snowflakenet_reduced": ("SnowflakeNet, reduced", "#E6A679"),
    "snowflakenet": ("SnowflakeNet", "#D55E00"),
    "snowflakenet.gpu": ("SnowflakeNet on the GPU", "#D55E00"),
}


def draw(numbers: Numbers, folder: Path) -> Path:
    """One dot a system, its milliseconds written beside it."""
    rows = [
        (*row, numbers[f"P.restore_ms.{name}"]) for name, row in _ROWS.items() if f"P.restore_ms.{name}" in numbers
    ]
    labels, colours, values = zip(*reversed(rows), strict=True)
    figure = Figure(figsize=(7.5, 0.8 + 0.4 * len(rows)), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.scatter(values, labels, c=colours, s=70, zorder=3)
    for label, value in zip(labels, values, strict=True):
        axes.annotate(
            f"{value:.{2 if value < 10 else 0}f} ms", (value, label), (9, -3), textcoords="offset points"
        )
    axes.margins(y=0.15)
    axes.set_xscale("log")
    axes.set_xlim(1.0, 3 * max(values))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("median milliseconds, 2,048 points; each line is ten times the last")
    axes.tick_params(labelsize=9)
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / NAME, metadata={"Software": None})  # else the same plot differs by version
    return folder / NAME
