"""The restored vessel: oblique and from above, measured and inferred points apart, with box, bow and keypoints."""

import math

import numpy as np

from shipshape.frames import wrap_angle
from shipshape.render.canvas import Canvas, Font, Rect
from shipshape.render.style import BOW, BOX, FAINT, INFERRED, KEYPOINT, MEASURED, MUTED, PANEL, WATER
from shipshape.render.views import Projection, View, bow_line, box_corners, fade, from_above, from_direction
from shipshape.types import Recognition

_QUARTER = math.radians(58)  # the viewer stands off the bow by so much, on the sensor's side
_ELEVATION = math.radians(24)
_EDGES = [*((i, (i + 1) % 4) for i in range(4)), *((i + 4, (i + 1) % 4 + 4) for i in range(4))]
_POSTS = [(i, i + 4) for i in range(4)]


def draw_restored_oblique(canvas: Canvas, area: Rect, recognition: Recognition) -> None:
    """Seen from off the bow, on the side that the sensor saw, a little from above."""
    x, y, _ = recognition.box.center_level
    side = math.copysign(1.0, wrap_angle(math.atan2(-y, -x) - recognition.heading))
    azimuth = recognition.heading + side * _QUARTER
    view = _fit(canvas, area, from_direction(azimuth, _ELEVATION), recognition)
    corners = box_corners(recognition.box, recognition.heading)
    canvas.polygon([view.spot(corner) for corner in corners[:4]], WATER, opacity=0.25)
    farthest = int(np.argmin(view.projection.nearness(corners)))
    _draw_edges(view, corners, [edge for edge in _EDGES + _POSTS if farthest in edge])
    _draw_cloud(view, recognition)
    _draw_edges(view, corners, [edge for edge in _EDGES + _POSTS if farthest not in edge])
    _draw_bow(view, recognition)
    view.scale_bar()


def draw_restored_from_above(canvas: Canvas, area: Rect, recognition: Recognition) -> None:
    """The chart, with the wedge of +- two standard deviations of the heading."""
    wedge = _wedge(recognition)
    view = _fit(canvas, area, from_above(), recognition, *wedge)
    corners = box_corners(recognition.box, recognition.heading)
    canvas.polygon([view.spot(point) for point in wedge], FAINT, opacity=0.55)
    _draw_cloud(view, recognition)
    _draw_edges(view, corners, _EDGES[4:])
    _draw_bow(view, recognition)
    view.scale_bar()
    canvas.text("up: ahead of the sensor", (area.right, area.bottom + 16), Font(MUTED, 12.0, anchor="right"))


def draw_point_legend(canvas: Canvas, right: float, y: float, recognition: Recognition) -> None:
    """How many points were measured and inferred, ending at `right`."""
    entries = [
        (f"{recognition.measured_points:,} measured", MEASURED),
        (f"{recognition.inferred_points:,} inferred", INFERRED),
        ("keypoints", KEYPOINT),
    ]
    for label, colour in reversed(entries):
        right -= canvas.text(label, (right, y), Font(MUTED, 12.0, anchor="right")) + 9
        if colour == KEYPOINT:
            canvas.ring((right, y - 4), 4.0, colour)
        else:
            canvas.dots(np.array([[right, y - 4]]), np.array([colour]), 3.5)
        right -= 16


def _fit(canvas: Canvas, area: Rect, projection: Projection, recognition: Recognition, *more: np.ndarray) -> View:
    """A view that holds the whole vessel, its box, its bow arrow and `more` points."""
    box, heading = recognition.box, recognition.heading
    shown = [recognition.restored.points_level, box_corners(box, heading), *bow_line(box, heading), *more]
    return View(canvas, area, projection, np.vstack(shown))


def _draw_cloud(view: View, recognition: Recognition) -> None:
    """Far points first, but what was measured over what was inferred; colours fade with distance."""
    points, measured = recognition.restored.points_level.astype(np.float64), recognition.restored.measured
    nearness = view.projection.nearness(points)
    places, order = view.place(points), np.argsort(nearness)
    colours = fade(np.where(measured[:, None], MEASURED, INFERRED), nearness, PANEL)
    for chosen, radius in ((order[~measured[order]], 1.3), (order[measured[order]], 1.8)):
        view.canvas.dots(places[chosen], colours[chosen], radius)
    for keypoint in recognition.keypoints_level:
        view.canvas.ring(view.spot(keypoint.tolist()), 6.0, KEYPOINT, 2.0)


def _draw_edges(view: View, corners: np.ndarray, edges: list[tuple[int, int]]) -> None:
    for start, end in edges:
        view.canvas.line([view.spot(corners[start]), view.spot(corners[end])], BOX, 1.2)


def _draw_bow(view: View, recognition: Recognition) -> None:
    middle, tip = bow_line(recognition.box, recognition.heading)
    bow = middle + (tip - middle) * (0.5 / 0.82)
    view.canvas.arrow(view.spot(bow), view.spot(tip), BOW, width=2.5, head=13.0)


def _wedge(recognition: Recognition) -> list[np.ndarray]:
    """Corners of the sector in which the bow lies within two standard deviations, level frame."""
    middle, tip = bow_line(recognition.box, recognition.heading)
    reach = float(np.linalg.norm(tip - middle))
    spread = min(2 * recognition.heading_std, math.pi / 2)
    angles = recognition.heading + np.linspace(-spread, spread, 17)
    return [middle, *(middle + reach * np.array([math.cos(angle), math.sin(angle), 0.0]) for angle in angles)]
