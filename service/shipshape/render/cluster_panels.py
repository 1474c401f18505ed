"""The raw cluster: from above with the line of sight, and as the LiDAR sees it."""

import math

import numpy as np

from shipshape.render.canvas import Canvas, Font, Rect
from shipshape.render.style import FAINT, GRID, MEASURED, MUTED, PANEL, TEXT, WATER
from shipshape.render.views import View, fade, from_above, from_direction
from shipshape.types import Contact

_SIGHT_PIXELS = 34.0  # length of the arrow along the line of sight
_SIGHT_GAP = 10.0  # pixels that it ends before the nearest point


def draw_cluster_from_above(canvas: Canvas, area: Rect, contact: Contact) -> None:
    """The chart of the cluster, with an arrow along the line of sight."""
    points = contact.points_level.astype(np.float64)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    reach = 0.6 * max(float(np.hypot(*np.ptp(points[:, :2], axis=0))), 2.0)
    corners = middle + reach * np.array([[1, 1, 0], [-1, -1, 0]])
    view = View(canvas, area, from_above(), corners)
    _draw_crosshair(canvas, area)
    _draw_points(view, points)
    range_m = math.hypot(middle[0], middle[1])
    _draw_sight(view, points, middle[:2] / max(range_m, 1e-6))
    view.scale_bar()
    note = f"line of sight: {range_m:.0f} m, bearing {math.degrees(math.atan2(middle[1], middle[0])):+.0f}°"
    canvas.text(note, (area.right, area.bottom + 16), Font(MUTED, 12.0, anchor="right"))


def draw_cluster_from_sensor(canvas: Canvas, area: Rect, contact: Contact, water_level: float) -> None:
    """What the LiDAR sees: across the line of sight to the right, up is up."""
    points = contact.points_level.astype(np.float64)
    middle = points.mean(axis=0)
    azimuth = math.atan2(-middle[1], -middle[0])
    view = View(canvas, area, from_direction(azimuth), np.vstack([points, [*middle[:2], water_level]]))
    water_y = view.spot((middle[0], middle[1], water_level))[1]
    canvas.line([(area.x, water_y), (area.right, water_y)], WATER, 1.5)
    _draw_points(view, points)
    view.scale_bar()
    canvas.text("waterline", (area.right, area.bottom + 16), Font(WATER, 12.0, anchor="right"))


def _draw_sight(view: View, points: np.ndarray, outward: np.ndarray) -> None:
    """An arrow from the sensor's side that ends short of the cluster."""
    middle = view.rect.centre
    towards_sensor = np.array([outward[1], outward[0]])  # in the picture, where y is down and port is left
    near = float(((view.place(points) - middle) @ towards_sensor).max()) + _SIGHT_GAP
    end, start = (np.array(middle) + towards_sensor * (near + length) for length in (0.0, _SIGHT_PIXELS))
    view.canvas.arrow((start[0], start[1]), (end[0], end[1]), TEXT, width=1.5, head=9.0)


def _draw_crosshair(canvas: Canvas, area: Rect) -> None:
    x, y = area.centre
    canvas.line([(x, area.y), (x, area.bottom)], GRID, 1.0)
    canvas.line([(area.x, y), (area.right, y)], GRID, 1.0)
    canvas.text("ahead", (x + 6, area.y + 10), Font(FAINT, 11.0))
    canvas.text("port", (area.x, y - 5), Font(FAINT, 11.0))


def _draw_points(view: View, points: np.ndarray) -> None:
    nearness = view.projection.nearness(points)
    order = np.argsort(nearness)
    colours = fade(np.tile(np.array(MEASURED, np.float64), (len(points), 1)), nearness, PANEL)
    radius = 2.2 if len(points) < 300 else 1.5
    view.canvas.dots(view.place(points)[order], colours[order], radius)
