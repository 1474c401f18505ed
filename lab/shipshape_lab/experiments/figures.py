"""Plots of the numbers: accuracy, heading, the hard test, calibration, confusion, restoration."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipshape_lab.experiments import hard
from shipshape_lab.experiments.markdown import asked, spoken
from shipshape_lab.experiments.numbers import DISTANCES, RELIABILITY_BINS, Numbers, aspect_names
from shipshape_lab.experiments.systems import BEST, IMAGE_METHODS

# Okabe and Ito's colours: they stay apart for every kind of colour vision.
_COLOURS = {
    "best": "#0072B2",
    "raw_spd2": "#000000",
    "mirrored_spd2": "#CC79A7",
    "pointnet": "#E69F00",
    "pointnet2": "#D55E00",
    "full_top": "#BFAE00",
    "full_side": "#009E73",
    "z_top": "#56B4E9",
    "z_side": "#999999",
    "paper": "#009E73",
    "pcn": "#E69F00",
    "snowflakenet": "#D55E00",
    "raw": "#000000",
    "mirrored": "#CC79A7",
    "mirrored_true_pose": "#999999",
    "surface": "#BBBBBB",
}
_ASPECTS = [name.removeprefix("aspect_").replace("_", "-") for name in aspect_names()]
_RESTORED = ("raw", "mirrored", "full_side", "z_side", "pcn", "snowflakenet", "best", "surface")


def draw_all(numbers: Numbers, folder: Path) -> None:
    """Draw every figure whose numbers are there."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (draw, needed, size) in FIGURES.items():
        if any(key.startswith(needed) for key in numbers):
            figure = Figure(figsize=size, dpi=100, layout="constrained")
            FigureCanvasAgg(figure)
            draw(figure, numbers)
            figure.savefig(folder / name, metadata={"Software": None})  # else the same plot differs by version


def _accuracy(figure: Figure, numbers: Numbers) -> None:
    left, right = figure.subplots(1, 2, sharey=True)
    for system in asked(numbers, "P.accuracy."):
        key = f"P.accuracy.{system}."
        _line(left, _by_distance(numbers, key, 100), system, DISTANCES)
        _line(right, _by_aspect(numbers, key, 100), system, _ASPECTS)
    _label(left, "distance, m", "right vessel on P, %")
    _label(right, "aspect, deg (0 bow-on, 180 stern-on)", "")
    figure.legend(*left.get_legend_handles_labels(), fontsize=8, loc="outside right center", frameon=False)


def _heading(figure: Figure, numbers: Numbers) -> None:
    left, middle, right = figure.subplots(1, 3)
    for system in ("best", "paper"):
        median, within = f"P.heading.{system}.median_deg.", f"P.heading.{system}.within_5deg."
        _line(left, _by_distance(numbers, median), system, DISTANCES)
        _line(middle, _by_distance(numbers, within, 100), system, DISTANCES)
        _line(right, _by_aspect(numbers, within, 100), system, _ASPECTS)
    left.set_ylim(bottom=0.0)
    _label(left, "distance, m", "median heading error on P, deg")
    _label(middle, "distance, m", "heading within 5 deg, %")
    _label(right, "aspect, deg", "heading within 5 deg, %")
    right.tick_params(axis="x", labelsize=7)
    middle.legend(fontsize=8)


def _hard(figure: Figure, numbers: Numbers) -> None:
    axes = figure.subplots()
    least = 100 * hard.LEAST_ACCURACY
    axes.axhline(least, color="0.4", linewidth=1.0, linestyle="--")
    axes.text(31, least - 0.5, "95 %: a line's reach ends where it first falls under", va="top", fontsize=8)
    for system in asked(numbers, "H.error."):
        if system in IMAGE_METHODS:
            continue  # without an "unknown" they get half of H wrong
        key, reach = f"H.window_accuracy.{system}.", numbers[f"H.reach_m.{system}"]
        shares = [100 * numbers.get(f"{key}{centre}m", float("nan")) for centre in hard.SHOWN_CENTRES_M]
        _line(axes, shares, f"{system}, reach {reach:.0f} m", hard.SHOWN_CENTRES_M, colour=_COLOURS[system])
        if reach > hard.NEAREST_M:
            axes.plot([reach], [least], "v", color=_COLOURS[system], markersize=9, zorder=4, clip_on=False)
    _label(axes, "range, m (middle of a window of 30 m)", "right decision on H, %")
    axes.set_xlim(hard.NEAREST_M, hard.FARTHEST_M)
    axes.legend(fontsize=8, loc="lower left")


def _reliability(figure: Figure, numbers: Numbers) -> None:
    for axes, name in zip(figure.subplots(1, 2, sharey=True), ("P", "H"), strict=True):
        axes.plot([0, 100], [0, 100], color="0.6", linewidth=1.0, linestyle="--")
        keys = [f"{name}.reliability.best.bin_{i:02d}" for i in range(RELIABILITY_BINS)]
        said, right, share = (
            np.array([numbers.get(f"{key}.{what}", np.nan) for key in keys]) for what in ("said", "right", "share")
        )
        axes.bar(100 * said, 100 * share, width=4.0, color="0.85", label="share of the clusters")
        axes.plot(100 * said, 100 * right, color=_COLOURS[BEST], marker="o", markersize=4, label="right")
        error = numbers.get(f"{name}.ece.best", float("nan"))
        axes.set_title(f"{name}: calibration error {100 * error:.2f} %", fontsize=10)
        _label(axes, "probability said, %", "share right, %" if name == "P" else "")
        axes.legend(fontsize=8, loc="upper left")


def _confusion(figure: Figure, numbers: Numbers) -> None:
    prefix = "H.confusion.best."
    names = list(
        dict.fromkeys(key.removeprefix(prefix).split(".")[0] for key in numbers if key.startswith(prefix))
    )
    names.sort(key=lambda name: name == hard.UNKNOWN)
    shares = np.array([[100 * numbers[f"{prefix}{true}.{said}"] for said in names] for true in names])
    axes = figure.subplots()
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=100)
    for (row, column), share in np.ndenumerate(shares):
        shade = "white" if share > 50 else "black"
        axes.text(column, row, f"{share:.1f}", ha="center", va="center", fontsize=9, color=shade)
    words = [spoken(name) for name in names]
    axes.set_xticks(range(len(names)), words, rotation=30, ha="right", fontsize=9)
    axes.set_yticks(range(len(names)), words, fontsize=9)
    axes.set_xlabel("called by best, % of the row")
    axes.set_ylabel("is (set H)")


def _restoration(figure: Figure, numbers: Numbers) -> None:
    left, right = figure.subplots(1, 2)
    for cloud in _RESTORED:
        if f"P.cd_l1.{cloud}" in numbers:
            _line(left, _by_distance(numbers, f"P.cd_l1.{cloud}."), cloud, DISTANCES)
            _line(right, _by_distance(numbers, f"P.fscore.{cloud}."), cloud, DISTANCES)
    left.set_ylim(bottom=0.0)
    right.set_ylim(bottom=0.0)
    _label(left, "distance, m", "CD-L1 x 1000 on P (lower is better)")
    _label(right, "distance, m", "F-score@1% on P (higher is better)")
    figure.legend(*left.get_legend_handles_labels(), fontsize=8, loc="outside right center", frameon=False)


Draw = Callable[[Figure, Numbers], None]
FIGURES: dict[str, tuple[Draw, str, tuple[float, float]]] = {
    "accuracy.png": (_accuracy, "P.accuracy.", (10.0, 3.6)),
    "heading.png": (_heading, "P.heading.best.", (9.0, 3.6)),
    "hard.png": (_hard, "H.error.", (8.0, 4.2)),
    "reliability.png": (_reliability, "P.reliability.", (9.0, 3.8)),
    "confusion.png": (_confusion, "H.confusion.", (5.6, 4.6)),
    "restoration.png": (_restoration, "P.cd_l1.", (10.0, 3.6)),
}


def _by_distance(numbers: Numbers, prefix: str, factor: float = 1.0) -> list[float]:
    return [factor * numbers.get(f"{prefix}{distance}m", float("nan")) for distance in DISTANCES]


def _by_aspect(numbers: Numbers, prefix: str, factor: float = 1.0) -> list[float]:
    return [factor * numbers.get(prefix + name, float("nan")) for name in aspect_names()]


def _line(
    axes: Axes, values: Sequence[float], label: str, places: Sequence[object], *, colour: str | None = None
) -> None:
    ours = label.startswith(BEST)
    axes.plot(
        places,
        values,
        color=colour or _COLOURS[label],
        linewidth=2.5 if ours else 1.2,
        linestyle="--" if label == "surface" else "-",
        marker="o",
        markersize=4 if ours else 2.5,
        zorder=3 if ours else 2,
        label=label,
    )


def _label(axes: Axes, across: str, up: str) -> None:
    axes.set_xlabel(across, fontsize=9)
    axes.set_ylabel(up, fontsize=9)
    axes.grid(color="0.9")
    axes.spines[["top", "right"]].set_visible(False)
