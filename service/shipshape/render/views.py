"""Where points in metres land in a panel: orthographic views with equal scales along both axes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from shipshape.render.canvas import Canvas, Font, Point, Rect
from shipshape.render.style import FAINT, MUTED
from shipshape.types import Box

_MIN_EXTENT = 2.0  # m; a single point still needs a scale
_STEPS = (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)


@dataclass(frozen=True, slots=True)
class Projection:
    """An orthographic view of the level frame: two unit vectors in the picture and one towards the viewer."""

    right: Float64[np.ndarray, " 3"]
    up: Float64[np.ndarray, " 3"]
    viewer: Float64[np.ndarray, " 3"]

    def __call__(self, points_level: np.ndarray) -> Float64[np.ndarray, "n 2"]:
        """Picture coordinates in metres, y up, of points (N, 3)."""
        return np.asarray(points_level @ np.column_stack([self.right, self.up]))

    def nearness(self, points_level: np.ndarray) -> Float64[np.ndarray, " n"]:
        """How near to the viewer each point is, metres, from an arbitrary origin."""
        return np.asarray(points_level @ self.viewer)


def from_above() -> Projection:
    """The chart: ahead of the sensor's own vessel is up, port is left."""
    return Projection(np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))


def from_direction(azimuth: float, elevation: float = 0.0) -> Projection:
    """Seen from the direction `azimuth` (level frame) at `elevation` over the horizon, both radians."""
    cos, sin = math.cos(azimuth), math.sin(azimuth)
    low, high = math.cos(elevation), math.sin(elevation)
    return Projection(
        right=np.array([-sin, cos, 0.0]),
        up=np.array([-cos * high, -sin * high, low]),
        viewer=np.array([cos * low, sin * low, high]),
    )


class View:
    """A projection fitted into a rectangle of a canvas."""

    def __init__(self, canvas: Canvas, rect: Rect, projection: Projection, shown: np.ndarray) -> None:
        """Fit so that all of `shown`, points (N, 3) of the level frame, lie inside `rect`."""
        self.canvas, self.rect, self.projection = canvas, rect, projection
        flat = projection(shown)
        low, high = flat.min(axis=0), flat.max(axis=0)
        extent = np.maximum(high - low, _MIN_EXTENT)
        self.pixels_per_metre = float(min(rect.width / extent[0], rect.height / extent[1]))
        self._middle = (low + high) / 2

    def place(self, points_level: np.ndarray) -> Float64[np.ndarray, "n 2"]:
        """Picture pixels of points (N, 3)."""
        flat = (self.projection(np.atleast_2d(points_level)) - self._middle) * self.pixels_per_metre
        return np.asarray(flat * (1, -1) + self.rect.centre)

    def spot(self, point_level: Sequence[float] | np.ndarray) -> Point:
        """Picture pixels of one point."""
        (x, y), *_ = self.place(np.asarray(point_level, np.float64)).tolist()
        return x, y

    def scale_bar(self) -> None:
        """A round number of metres, about a fifth of the view, at its lower left."""
        wanted = self.rect.width / 5 / self.pixels_per_metre
        metres = max((step for step in _STEPS if step <= wanted), default=_STEPS[0])
        x, y = self.rect.x, self.rect.bottom + 12
        end = x + metres * self.pixels_per_metre
        for stroke in ([(x, y), (end, y)], [(x, y - 3), (x, y + 3)], [(end, y - 3), (end, y + 3)]):
            self.canvas.line(stroke, FAINT, 1.5)
        self.canvas.text(f"{metres:g} m", (end + 7, y + 4), Font(MUTED, 12.0))


def box_corners(box: Box, heading: float) -> Float64[np.ndarray, "8 3"]:
    """Corners of the box, level frame: four on the waterline, from the port bow clockwise, and four above."""
    half_x, half_y, half_z = box.size.length / 2, box.size.beam / 2, box.size.height / 2
    along = np.array([math.cos(heading), math.sin(heading), 0.0]) * half_x
    port = np.array([-math.sin(heading), math.cos(heading), 0.0]) * half_y
    up = np.array([0.0, 0.0, half_z])
    ring = np.array([along + port, along - port, -along - port, -along + port])
    return np.asarray(np.concatenate([ring - up, ring + up]) + box.center_level)


def bow_line(box: Box, heading: float, reach: float = 0.32) -> tuple[np.ndarray, np.ndarray]:
    """From the middle of the box on the waterline to beyond the bow by `reach` lengths, level frame."""
    x, y, z = box.center_level
    middle = np.array([x, y, z - box.size.height / 2])
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0]) * box.size.length
    return middle, middle + ahead * (0.5 + reach)


def fade(colours: np.ndarray, nearness: np.ndarray, background: Sequence[int]) -> Float32[np.ndarray, "n 3"]:
    """Colours (N, 3), the far ones drowned in the background: the only depth cue of a parallel view."""
    span = float(np.ptp(nearness)) if len(nearness) else 0.0
    share = (nearness - nearness.min()) / span if span > 1e-6 else np.ones_like(nearness)
    weight = (0.45 + 0.55 * share)[:, None]
    return np.asarray(weight * colours + (1 - weight) * np.asarray(background), np.float32)
