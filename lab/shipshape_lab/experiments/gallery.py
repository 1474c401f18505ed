"""One picture of what restoration does: each catalogue vessel near, farther and far; measured, restored, truth.

    python -m shipshape_lab.experiments.gallery --set P --data runs/data --bundle models --out docs/figures

Clouds of set P or H by preset `best`, drawn in the true vessel frame, seen from ahead of the beam that the sensor
does not see: there lies what must be inferred.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from tqdm import tqdm

from shipshape.bundle import UNKNOWN, load_bundle
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, Recognition
from shipshape_lab.metrics import bow_right, heading_error_deg
from shipshape_lab.training.examples import Example, Examples

DISTANCES = {"P": (30, 70, 110), "H": (40, 100, 160)}
FILES = {"P": "gallery.png", "H": "gallery_hard.png"}
SLACK_M = {"P": 1.0, "H": 12.0}
COLUMNS = ("measured", "restored", "truth")
HEADING_DEG = 240  # the sensor looks at the starboard bow
TRUTH_POINTS = 4_000
ELEVATION_DEG = 22.0
AZIMUTH_OFF_BOW_DEG = 50.0
MEASURED, INFERRED, TRUTH = "#D55E00", "#0072B2", "#555555"


def nearest_cluster(examples: Examples, label: int, distance: float, slack_m: float) -> int:
    """The cluster of this vessel at about a distance whose heading is nearest to HEADING_DEG.

    Args:
        examples: the set.
        label: number of the vessel in the catalogue.
        distance: metres.
        slack_m: how much farther off this distance a cluster may be than the nearest one.

    Raises:
        ValueError: the set has no cluster of this vessel.
    """
    clusters = examples.clusters
    usable = examples.indices[examples.labels[examples.indices] == label]
    if len(usable) == 0:
        raise ValueError(f"expected clusters of catalogue vessel {label} in the set, got none")
    off = np.abs(clusters.range_m[usable] - distance)
    usable = usable[off <= off.min() + slack_m]
    turned = np.cos(clusters.heading[usable] - np.radians(HEADING_DEG))
    return int(usable[np.argmax(turned)])


def seen_from_far(points_vessel: np.ndarray, side: float) -> np.ndarray:
    """Picture coordinates (right, up, towards the eye) of points; the eye is off the bow, on `side`.

    Args:
        points_vessel: (n, 3), vessel frame, metres.
        side: 1 for port, -1 for starboard.

    Returns:
        (n, 3) metres; parallel projection.
    """
    azimuth, elevation = np.radians(side * AZIMUTH_OFF_BOW_DEG), np.radians(ELEVATION_DEG)
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    towards = np.array(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    return points_vessel @ np.stack([right, np.cross(towards, right), towards], axis=1)


def _draw(axes: Axes, points: np.ndarray, side: float, colours: np.ndarray | str) -> None:
    seen = seen_from_far(points, side)
    order = np.argsort(seen[:, 2])  # the near over the far
    shade = colours if isinstance(colours, str) else colours[order]
    axes.scatter(seen[order, 0], seen[order, 1], s=0.7, c=shade, linewidths=0, rasterized=True)


def _draw_row(row: list[Axes], example: Example, said: Recognition) -> None:
    """Measured, restored and true cloud of one example, all to one scale."""
    hidden = _hidden_side(example)
    surface = example.pose.to_vessel(example.surface_level[:TRUTH_POINTS])
    restored = example.pose.to_vessel(said.restored.points_level)
    colours = np.where(said.restored.measured, MEASURED, INFERRED)
    _draw(row[0], example.pose.to_vessel(example.contact.points_level), hidden, MEASURED)
    _draw(row[1], restored, hidden, colours)
    _draw(row[2], surface, hidden, TRUTH)
    outline = seen_from_far(surface, hidden)
    middle = (outline.max(axis=0) + outline.min(axis=0)) / 2
    width, height = np.ptp(outline, axis=0)[:2] * 0.58
    for axes in row:
        axes.set(xlim=(middle[0] - width, middle[0] + width), ylim=(middle[1] - height, middle[1] + height))
        axes.set_aspect("equal", adjustable="box")
        axes.set_axis_off()
    range_m = np.hypot(*example.pose.origin_level[:2])
    row[0].set_title(f"{len(example.contact.points_level)} points, {range_m:.0f} m", fontsize=7, pad=2)
    row[1].set_title(_caption(said, example), fontsize=7, pad=2)


def _hidden_side(example: Example) -> float:
    """1 if the sensor sees starboard, so that port is hidden; else -1."""
    sensor = example.pose.to_vessel(np.zeros((1, 3), np.float32))
    return 1.0 if sensor[0, 1] < 0 else -1.0


def _caption(said: Recognition, example: Example) -> str:
    error = float(heading_error_deg(np.array(said.heading), np.array(example.pose.heading)))
    bow = "" if bow_right(np.array(said.heading), np.array(example.pose.heading)) else ", bow wrong"
    name, probability = said.vessel.replace("_", " "), said.probability
    if said.unknown:
        name, probability = UNKNOWN, said.probabilities[UNKNOWN]
    return f"{name} {probability:.0%}, {error:.1f}° off{bow}"


def draw(examples: Examples, pipeline: Pipeline, distances: Sequence[int], slack_m: float) -> Figure:
    """The whole picture: a row a vessel, three panels a distance."""
    names = [vessel.name for vessel in pipeline.bundle.catalogue]
    columns = len(distances) * len(COLUMNS)
    figure = Figure(figsize=(16.0, 1.35 * len(names) + 0.3), dpi=90)
    FigureCanvasAgg(figure)
    figure.subplots_adjust(left=0.015, right=0.999, bottom=0.005, top=0.93, wspace=0.03, hspace=0.15)
    grid = figure.subplots(len(names), columns, squeeze=False)
    for label in tqdm(range(len(names)), desc="gallery"):
        for block, distance in enumerate(distances):
            example = examples.example(nearest_cluster(examples, label, distance, slack_m))
            said = pipeline.run(Contact(example.contact.points_level))
            _draw_row(list(grid[label, 3 * block : 3 * block + 3]), example, said)
    heads = [f"{distance} m {column}" for distance in distances for column in COLUMNS]
    _write_names(figure, grid, names, heads)
    return figure


def _write_names(figure: Figure, grid: np.ndarray, names: list[str], heads: list[str]) -> None:
    for axes, head in zip(grid[0], heads, strict=True):
        place = axes.get_subplotspec().get_position(figure)
        figure.text((place.x0 + place.x1) / 2, 0.975, head, ha="center", fontsize=9, weight="bold")
    for axes, name in zip(grid[:, 0], names, strict=True):
        place = axes.get_subplotspec().get_position(figure)
        middle = (place.y0 + place.y1) / 2
        figure.text(0.004, middle, name.replace("_", " "), rotation=90, va="center", fontsize=9)


def main(argv: list[str] | None = None) -> None:
    """Command line: writes OUT/gallery.png, or gallery_hard.png of H."""
    parser = argparse.ArgumentParser(
        prog="python -m shipshape_lab.experiments.gallery",
        description="Draws measured, restored and true clouds of each catalogue vessel.",
        epilog="example: python -m shipshape_lab.experiments.gallery --data runs/data --out docs/figures",
    )
    parser.add_argument("--set", choices=tuple(FILES), default="P", help="the test set (default P)")
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--out", type=Path, default=Path("docs/figures"), help="folder of the picture")
    args = parser.parse_args(argv)
    examples, pipeline = Examples.read(args.data, args.set), Pipeline(load_bundle(args.bundle))
    figure = draw(examples, pipeline, DISTANCES[args.set], SLACK_M[args.set])
    args.out.mkdir(parents=True, exist_ok=True)
    figure.savefig(args.out / FILES[args.set], metadata={"Software": None})
    print(f"wrote {args.out / FILES[args.set]}")


if __name__ == "__main__":
    main()
