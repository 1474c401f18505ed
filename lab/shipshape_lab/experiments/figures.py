"""Plots of the numbers: accuracy, heading and restoration by distance and aspect."""

from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipshape_lab.experiments.numbers import DISTANCES, Numbers, aspect_names
from shipshape_lab.experiments.systems import SYSTEMS

# Okabe and Ito's colours: they stay apart for every kind of colour vision.
_COLOURS = {
    "best": "#0072B2",
    "raw_spd2": "#000000",
    "full_top": "#E69F00",
    "full_side": "#D55E00",
    "z_top": "#56B4E9",
    "z_side": "#009E73",
    "paper": "#D55E00",
    "raw": "#000000",
    "mirrored": "#CC79A7",
    "mirrored_true_pose": "#999999",
    "surface": "#BBBBBB",
}
_ASPECTS = [name.removeprefix("aspect_").replace("_", "-") for name in aspect_names()]
_RESTORED = ("raw", "mirrored", "best", "full_top", "full_side", "z_top", "z_side", "surface")


def draw_all(numbers: Numbers, folder: Path) -> list[str]:
    """Draw every figure whose numbers are there; the names of the files, in the order of the text."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = []
    for name, (draw, needed) in FIGURES.items():
        if any(key.startswith(needed) for key in numbers):
            figure = Figure(figsize=(9.0, 3.6), dpi=100, layout="constrained")
            FigureCanvasAgg(figure)
            draw(figure, numbers)
            figure.savefig(folder / name, metadata={"Software": None})  # else the same plot differs by version
            drawn.append(name)
    return drawn


def _accuracy(figure: Figure, numbers: Numbers) -> None:
    left, right = figure.subplots(1, 2, sharey=True)
    for system in SYSTEMS:
        key = f"P.accuracy.{system}."
        _line(left, _by_distance(numbers, key, 100), system, DISTANCES)
        _line(right, _by_aspect(numbers, key, 100), system, _ASPECTS)
    _label(left, "distance, m", "right vessel, %")
    _label(right, "aspect, deg (0 bow-on, 180 stern-on)", "")
    right.legend(fontsize=8)


def _heading(figure: Figure, numbers: Numbers) -> None:
    left, middle, right = figure.subplots(1, 3)
    for system in ("best", "paper"):
        median, within = f"P.heading.{system}.median_deg.", f"P.heading.{system}.within_5deg."
        _line(left, _by_distance(numbers, median), system, DISTANCES)
        _line(middle, _by_distance(numbers, within, 100), system, DISTANCES)
        _line(right, _by_aspect(numbers, within, 100), system, _ASPECTS)
    left.set_ylim(bottom=0.0)
    _label(left, "distance, m", "median heading error, deg")
    _label(middle, "distance, m", "heading within 5 deg, %")
    _label(right, "aspect, deg", "heading within 5 deg, %")
    right.tick_params(axis="x", labelsize=7)
    middle.legend(fontsize=8)


def _restoration(figure: Figure, numbers: Numbers) -> None:
    left, right = figure.subplots(1, 2)
    for cloud in _RESTORED:
        chamfer, share = f"P.cd_l1.{cloud}.", f"P.fscore.{cloud}."
        _line(left, _by_distance(numbers, chamfer), cloud, DISTANCES)
        _line(right, _by_distance(numbers, share), cloud, DISTANCES)
    left.set_ylim(bottom=0.0)
    right.set_ylim(bottom=0.0)
    _label(left, "distance, m", "CD-L1 x 1000 (lower is better)")
    _label(right, "distance, m", "F-score@1% (higher is better)")
    right.legend(fontsize=7, ncols=2)


FIGURES: dict[str, tuple[Callable[[Figure, Numbers], None], str]] = {
    "accuracy.png": (_accuracy, "P.accuracy."),
    "heading.png": (_heading, "P.heading."),
    "restoration.png": (_restoration, "P.cd_l1."),
}


def _by_distance(numbers: Numbers, prefix: str, factor: float = 1.0) -> list[float]:
    return [factor * numbers.get(f"{prefix}{distance}m", float("nan")) for distance in DISTANCES]


def _by_aspect(numbers: Numbers, prefix: str, factor: float = 1.0) -> list[float]:
    return [factor * numbers.get(prefix + name, float("nan")) for name in aspect_names()]


def _line(axes: Axes, values: Sequence[float], system: str, places: Sequence[object]) -> None:
    ours = system == "best"
    axes.plot(
        places,
        values,
        color=_COLOURS[system],
        linewidth=2.5 if ours else 1.2,
        linestyle="--" if system == "surface" else "-",
        marker="o",
        markersize=4 if ours else 2.5,
        zorder=3 if ours else 2,
        label=system,
    )


def _label(axes: Axes, across: str, up: str) -> None:
    axes.set_xlabel(across, fontsize=9)
    axes.set_ylabel(up, fontsize=9)
    axes.grid(color="0.9")
    axes.spines[["top", "right"]].set_visible(False)
