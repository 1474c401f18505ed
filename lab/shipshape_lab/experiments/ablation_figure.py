"""Heat maps of accuracy over r and d_min, one for the raw and one for the restored cloud."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from shipshape_lab.experiments.numbers import Numbers

NAME = "ablation.png"
_TITLES = {"raw_spd2": "raw cluster", "full_side": "restored, full_side"}
_SERVED_CM = 50  # r and d_min of the service


def draw(numbers: Numbers, folder: Path) -> Path:
    """Write the figure; returns its path."""
    figure = Figure(figsize=(10.0, 4.8), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    steps = range(30, 101, 10)
    for axes, (system, title) in zip(figure.subplots(1, 2), _TITLES.items(), strict=True):
        cells = [[numbers[f"validation.ablation.{system}.r_{r}cm_d_{d}cm"] for r in steps] for d in steps]
        _heat(axes, 100 * np.array(cells), steps)
        axes.set_title(f"{title}: right vessel, %", fontsize=10)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / NAME, metadata={"Software": None})  # else the same plot differs by version
    return folder / NAME


def _heat(axes: Axes, percent: np.ndarray, steps: Sequence[int]) -> None:
    # One colour scale of at least 4 points, so that noise does not look like a pattern.
    middle, half = (percent.max() + percent.min()) / 2, max(np.ptp(percent) / 2, 2.0)
    axes.imshow(percent, origin="lower", cmap="viridis", vmin=middle - half, vmax=middle + half)
    for (row, column), value in np.ndenumerate(percent):
        dark = value < middle + half / 3
        axes.text(column, row, f"{value:.1f}", ha="center", va="center", fontsize=8, color="w" if dark else "k")
    served = steps.index(_SERVED_CM) - 0.5
    axes.add_patch(Rectangle((served, served), 1, 1, fill=False, edgecolor="#D55E00", linewidth=2.5))
    labels = [f"{step / 100:.1f}" for step in steps]
    axes.set_xticks(range(len(labels)), labels)
    axes.set_yticks(range(len(labels)), labels)
    axes.set_xlabel("r, m", fontsize=9)
    axes.set_ylabel("d_min, m", fontsize=9)
