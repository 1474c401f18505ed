"""Vessels that a generative restorer draws, beside the deterministic one's and the truth, on the hard test.

Clouds in the true vessel frame, seen from the side that the sensor does not see, as in the gallery.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipshape.pipeline import Pipeline
from shipshape_lab.experiments import gallery
from shipshape_lab.experiments.generative_spread import DETERMINISTIC, restorations, started
from shipshape_lab.training.examples import Example, Examples

NAME = "generative.png"
SYSTEM = "flow_4"
DRAWN = 3
ROWS = ((1, 60), (3, 90), (2, 130))  # number in the catalogue, and about how far, m
HEADS = ("measured", "deterministic", "flow, sample 1", "flow, sample 2", "flow, sample 3", "truth")


def draw(samplers: dict[str, Pipeline], examples: Examples, folder: Path) -> Path:
    """A row a cluster: measured, deterministic, three samples, truth; orange is measured, blue inferred.

    Args:
        samplers: of `samplers_of`, DETERMINISTIC and SYSTEM among them.
        examples: set H.
        folder: of the picture.
    """
    figure = Figure(figsize=(15.0, 1.75 * len(ROWS)), dpi=90)
    FigureCanvasAgg(figure)
    figure.subplots_adjust(left=0.002, right=0.998, bottom=0.0, top=0.9, wspace=0.02, hspace=0.22)
    grid = figure.subplots(len(ROWS), len(HEADS), squeeze=False)
    for row, (label, distance) in zip(grid, ROWS, strict=True):
        i = gallery.nearest_cluster(examples, label, distance, gallery.SLACK_M["H"])
        example = examples.example(i)
        _row(row, samplers, example)
        _caption(row[0], example, samplers[SYSTEM].bundle.catalogue[label].name)
    for axes, head in zip(grid[0], HEADS, strict=True):
        place = axes.get_subplotspec().get_position(figure)
        figure.text((place.x0 + place.x1) / 2, 0.955, head, ha="center", fontsize=11, weight="bold")
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / NAME, metadata={"Software": None})  # else the same plot differs by version
    return folder / NAME


def _row(row: np.ndarray, samplers: dict[str, Pipeline], example: Example) -> None:
    points = example.contact.points_level
    start = started(samplers[DETERMINISTIC], points)
    plain, _ = restorations(samplers[DETERMINISTIC], start)
    samples, _ = restorations(samplers[SYSTEM], start)
    surface = example.surface_level[: gallery.TRUTH_POINTS]
    side = 1.0 if example.pose.to_vessel(np.zeros((1, 3), np.float32))[0, 1] < 0 else -1.0
    seen = gallery.seen_from_far(example.pose.to_vessel(surface), side)
    middle, half = (seen.max(axis=0) + seen.min(axis=0)) / 2, np.ptp(seen, axis=0) * 0.58
    for axes, cloud in zip(row, [points, *plain, *samples[:DRAWN], surface], strict=True):
        # The measured points come first in a restored cloud.
        colours = np.where(np.arange(len(cloud)) < len(points), gallery.MEASURED, gallery.INFERRED)
        drawn = gallery.seen_from_far(example.pose.to_vessel(cloud), side)
        _scatter(axes, drawn, np.full(len(cloud), gallery.TRUTH) if cloud is surface else colours)
        axes.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] - half[1], middle[1] + half[1]))


def _scatter(axes: Axes, seen: np.ndarray, colours: np.ndarray) -> None:
    order = np.argsort(seen[:, 2])  # the near over the far
    axes.scatter(seen[order, 0], seen[order, 1], s=0.9, c=colours[order], linewidths=0, rasterized=True)
    axes.set_aspect("equal", adjustable="box")
    axes.set_axis_off()


def _caption(axes: Axes, example: Example, name: str) -> None:
    range_m = np.hypot(*example.pose.origin_level[:2])
    text = f"{name.replace('_', ' ')}, {len(example.contact.points_level)} points, {range_m:.0f} m"
    axes.set_title(text, fontsize=8, pad=3)
