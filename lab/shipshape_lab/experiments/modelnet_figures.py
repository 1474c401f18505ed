"""Figures of the paper's first experiment: the masks, what each method restores, and CD-L1 against the loss."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipshape_lab.experiments.gallery import seen_from_far
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.modelnet import masks
from shipshape_lab.modelnet.methods import BEST, METHODS, Method
from shipshape_lab.modelnet.shapes import KINDS, Shape

SHOWN_RATE = 50  # the loss that the paper's own pictures show
_LEFT, _LOST, _RESTORED, _COMPLETE = "#D55E00", "#D8D8D8", "#0072B2", "#555555"
_COLOURS = {  # as in the other figures
    "raw": "#000000",
    "full_top": "#E69F00",
    "full_side": "#D55E00",
    "z_top": "#56B4E9",
    "z_side": "#009E73",
    "best": "#0072B2",
}
_GAP = 6  # white pixels between two pictures


def draw(
    numbers: Numbers, shapes: list[Shape], restorers: dict[str, Method], seed: int, folder: Path
) -> list[Path]:
    """Write all figures; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    shown = _examples(shapes)
    figures = {"modelnet_masks": _masks(shown[0], seed), "modelnet_cd_l1": _against_loss(numbers)}
    figures |= {f"modelnet_{mask}": _gallery(shown, mask, restorers, seed) for mask in masks.MASKS}
    paths = []
    for name, figure in figures.items():
        paths.append(folder / f"{name}.png")
        figure.savefig(paths[-1], metadata={"Software": None})  # else the same plot differs by version
    return paths


def _examples(shapes: list[Shape]) -> list[Shape]:
    """The middle test shape of each kind in the order of names: chosen before anything was restored."""
    kinds = [[shape for shape in shapes if shape.kind == kind] for kind in KINDS]
    return [of_kind[len(of_kind) // 2] for of_kind in kinds if of_kind]


def _left(shape: Shape, mask: str, rate: int, seed: int) -> np.ndarray:
    return masks.kept(shape.points, mask, rate, masks.chance(shape.name, mask, rate, seed))


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _scatter(axes: Axes, points: np.ndarray, colour: np.ndarray | str, shape: Shape) -> None:
    """Points seen from off the bow, to the scale of the complete shape."""
    seen = seen_from_far(points, 1.0)
    order = np.argsort(seen[:, 2])  # the near over the far
    axes.scatter(*seen[order, :2].T, s=0.6, c=colour if isinstance(colour, str) else colour[order], linewidths=0)
    outline = seen_from_far(shape.points, 1.0)
    middle = (outline.max(axis=0) + outline.min(axis=0)) / 2
    width, height = np.ptp(outline, axis=0)[:2] * 0.56
    axes.set(xlim=(middle[0] - width, middle[0] + width), ylim=(middle[1] - height, middle[1] + height))
    axes.set_aspect("equal")
    axes.set_axis_off()


def _masks(shape: Shape, seed: int) -> Figure:
    """One shape under every mask (rows) and loss (columns)."""
    figure = _figure(9.0, 6.0)
    grid = figure.subplots(len(masks.MASKS), len(masks.RATES))
    for row, mask in zip(grid, masks.MASKS, strict=True):
        for axes, rate in zip(row, masks.RATES, strict=True):
            left = _left(shape, mask, rate, seed)
            order = np.argsort(left)  # what is left over what is lost
            _scatter(axes, shape.points[order], np.where(left[order], _LEFT, _LOST), shape)
            axes.set_title(f"{mask.replace('_', ' ')}, {rate} % lost", fontsize=9)
    figure.suptitle("orange: what the mask leaves, grey: what it takes", fontsize=9)
    return figure


def _gallery(shown: Sequence[Shape], mask: str, restorers: dict[str, Method], seed: int) -> Figure:
    """For each shape a row of clouds, and under it the picture of each method before and after inpainting."""
    figure = _figure(14.0, 3.1 * len(shown))
    grid = figure.subplots(2 * len(shown), 2 + len(METHODS), height_ratios=[3, 2] * len(shown))
    for shape, clouds, pictures in zip(shown, grid[::2], grid[1::2], strict=True):
        left = shape.points[_left(shape, mask, SHOWN_RATE, seed)]
        _scatter(clouds[0], shape.points, _COMPLETE, shape)
        _scatter(clouds[1], left, _LEFT, shape)
        clouds[0].set_title(f"{shape.kind}: complete", fontsize=9)
        clouds[1].set_title(f"{mask.replace('_', ' ')}, {SHOWN_RATE} % lost", fontsize=9)
        for axes, below, name in zip(clouds[2:], pictures[2:], METHODS, strict=True):
            restored = restorers[name].restore(left, shape.pose)
            _scatter(axes, restored.points, _RESTORED, shape)
            axes.set_title(name, fontsize=9)
            gap = np.full((restored.before.shape[0], _GAP, 3), 255, np.uint8)
            below.imshow(np.concatenate([restored.before, gap, restored.after], axis=1)[:, :, ::-1])
        for axes in pictures:
            axes.set_axis_off()
        pictures[1].text(1.0, 0.5, "picture before and\nafter inpainting", ha="right", va="center", fontsize=8)
    return figure


def _against_loss(numbers: Numbers) -> Figure:
    """CD-L1 of every method against the loss, a panel a mask."""
    figure = _figure(12.0, 3.4)
    panels = figure.subplots(1, len(masks.MASKS), sharey=True)
    for axes, mask in zip(panels, masks.MASKS, strict=True):
        for name, colour in _COLOURS.items():
            values = [numbers[f"M.cd_l1.{name}.{mask}_{rate}"] for rate in masks.RATES]
            width = 2.5 if name == BEST else 1.2
            axes.plot(masks.RATES, values, color=colour, linewidth=width, marker="o", markersize=3, label=name)
        axes.set_title(mask.replace("_", " "), fontsize=10)
        axes.set_xlabel("points lost, %", fontsize=9)
        axes.set_xticks(masks.RATES)
        axes.grid(color="0.9")
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_yscale("log")
    panels[0].set_ylabel("CD-L1 x 1000 (lower is better)", fontsize=9)
    panels[-1].legend(fontsize=8)
    return figure
