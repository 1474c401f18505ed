"""Accuracy of Experiment 2 by distance and by aspect, one row for each way of training the classifiers."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipshape_lab.experiments.numbers import DISTANCES, Numbers, aspect_names

NAME = "experiment_2.png"
_ROWS = {
    "complete": "trained on complete clouds (3.3.2)",
    "restored": "trained on restored clouds (4.1.2), raw_spd2 on raw ones",
}
# Okabe and Ito's colours, as in the other figures.
_COLOURS = {
    "raw_spd2": "#000000",
    "full_top": "#E69F00",
    "full_side": "#D55E00",
    "z_top": "#56B4E9",
    "z_side": "#009E73",
}


def draw(numbers: Numbers, folder: Path) -> Path:
    """Write the figure; returns its path."""
    figure = Figure(figsize=(9.0, 6.4), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(_ROWS), 2, sharey="row")
    columns = (
        ([f"{distance}m" for distance in DISTANCES], "distance, m"),
        (aspect_names(), "aspect, deg (0 bow-on, 180 stern-on)"),
    )
    for (trained, title), row in zip(_ROWS.items(), grid, strict=True):
        for axes, (parts, across) in zip(row, columns, strict=True):
            _panel(axes, numbers, f"P.accuracy_{trained}", parts)
            axes.set_title(title, fontsize=10)
            axes.set_xlabel(across, fontsize=9)
        row[0].set_ylabel("right vessel, %", fontsize=9)
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=9, frameon=False)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / NAME, metadata={"Software": None})  # else the same plot differs by version
    return folder / NAME


def _panel(axes: Axes, numbers: Numbers, key: str, parts: Sequence[str]) -> None:
    ticks = [part.removeprefix("aspect_").removesuffix("m").replace("_", "-") for part in parts]
    for system, colour in _COLOURS.items():
        values = [100 * numbers.get(f"{key}.{system}.{part}", float("nan")) for part in parts]
        axes.plot(ticks, values, color=colour, linewidth=1.4, marker="o", markersize=3, label=system)
    axes.tick_params(labelsize=8)
    axes.grid(color="0.9")
    axes.spines[["top", "right"]].set_visible(False)
