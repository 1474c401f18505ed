"""Heading error of every method by distance and by aspect."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipshape_lab.experiments.numbers import DISTANCES, Numbers, aspect_names

NAME = "heading_peers.png"
# Okabe and Ito's colours, as in the other figures.
STYLES = {
    "best": ("best (no class needed)", "#0072B2"),
    "paper": ("area projection, class from the prior", "#D55E00"),
    "area_projection_told": ("area projection, true class told", "#E69F00"),
    "l_shape": ("L-shape, closeness", "#009E73"),
    "min_area": ("rectangle of least area", "#CC79A7"),
    "pca": ("principal axis", "#999999"),
}


def draw(numbers: Numbers, folder: Path) -> Path:
    """Share within 5 deg on P by distance and by aspect, and on H by distance where it was measured."""
    aspects = aspect_names()
    bands = [key.rsplit(".", 1)[1] for key in numbers if key.startswith("H.heading.best.within_5deg.")]
    bands = [band for band in bands if band.endswith("m")]
    panels = [
        (
            "P",
            [f"{distance}m" for distance in DISTANCES],
            [str(distance) for distance in DISTANCES],
            "distance, m",
        ),
        ("P", aspects, [_spoken(name) for name in aspects], "aspect, deg (0 bow-on, 180 stern-on)"),
    ]
    if bands:
        panels.append(("H", bands, [_spoken(band) for band in bands], "distance, m"))
    figure = Figure(figsize=(4.2 * len(panels), 4.2), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (name, parts, ticks, across) in zip(
        figure.subplots(1, len(panels), sharey=True), panels, strict=True
    ):
        for method in STYLES:
            values = [
                100 * numbers.get(f"{name}.heading.{method}.within_5deg.{part}", float("nan")) for part in parts
            ]
            _line(axes, ticks, values, method)
        _label(axes, "paper grid P" if name == "P" else "hard set H", across)
    figure.axes[0].set_ylabel("heading within 5 deg, %", fontsize=9)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / NAME, metadata={"Software": None})  # else the same plot differs by version
    return folder / NAME


def _spoken(part: str) -> str:
    return part.removeprefix("aspect_").removesuffix("m").replace("_", "-")


def _line(axes: Axes, ticks: Sequence[str], values: Sequence[float], method: str) -> None:
    label, colour = STYLES[method]
    ours = method == "best"
    width, size = (2.5, 5) if ours else (1.3, 3)
    axes.plot(ticks, values, color=colour, linewidth=width, marker="o", markersize=size, label=label)


def _label(axes: Axes, title: str, across: str) -> None:
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(across, fontsize=9)
    axes.set_ylim(0.0, 102.0)
    axes.tick_params(labelsize=8)
    axes.grid(color="0.9")
    axes.spines[["top", "right"]].set_visible(False)
