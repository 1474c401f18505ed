"""Triangle shapes in the vessel frame, and the few ways to move, join and cut them.

Everything a vessel is made of is a `Shape`; only the finished vessel becomes a `trimesh.Trimesh`, because
building hundreds of small meshes would cost far more than the arrays they hold.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Shape:
    """Vertices (n, 3), metres, vessel frame, and triangles (m, 3) as indices into them."""

    vertices: np.ndarray
    faces: np.ndarray

    def moved(self, *, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> "Shape":
        """The same shape shifted by metres along the vessel axes."""
        return Shape(self.vertices + np.array([x, y, z]), self.faces)

    def mirrored(self) -> "Shape":
        """The same shape on the other side of the centreline, still facing outwards."""
        return Shape(self.vertices * np.array([1.0, -1.0, 1.0]), self.faces[:, ::-1])

    def turned(self, yaw: float) -> "Shape":
        """The same shape turned about its own z axis, radians, counter-clockwise from above."""
        cos, sin = np.cos(yaw), np.sin(yaw)
        return Shape(self.vertices @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]), self.faces)


def joined(shapes: Iterable[Shape]) -> Shape:
    """One shape holding all triangles of `shapes`."""
    shapes = list(shapes)
    offsets = np.cumsum([0] + [len(shape.vertices) for shape in shapes[:-1]])
    faces = [shape.faces + offset for shape, offset in zip(shapes, offsets, strict=True)]
    return Shape(np.concatenate([shape.vertices for shape in shapes]), np.concatenate(faces))


def both_sides(shape: Shape) -> Shape:
    """A shape and its mirror image across the centreline."""
    return joined([shape, shape.mirrored()])


def above_water(shape: Shape) -> Shape:
    """The part of a shape at z >= 0; triangles that cross the waterline are cut along it.

    Args:
        shape: any shape, z = 0 on the waterline.

    Returns:
        A shape without vertices below z = 0; cut triangles get their own vertices on z = 0.
    """
    triangles = shape.vertices[shape.faces]
    wet = triangles[:, :, 2] < 0.0
    dry = shape.faces[~wet.any(axis=1)]
    one_dry, two_dry = wet.sum(axis=1) == 2, wet.sum(axis=1) == 1
    tip = _lone_corner_first(triangles[one_dry], ~wet[one_dry])
    lost = _lone_corner_first(triangles[two_dry], wet[two_dry])
    tips = np.stack([tip[:, 0], _crossing(tip[:, 0], tip[:, 1]), _crossing(tip[:, 0], tip[:, 2])], axis=1)
    left, right = _crossing(lost[:, 0], lost[:, 1]), _crossing(lost[:, 0], lost[:, 2])
    near = np.stack([left, lost[:, 1], lost[:, 2]], axis=1)
    far = np.stack([left, lost[:, 2], right], axis=1)
    cut = np.concatenate([tips, near, far]).reshape(-1, 3)
    used, renumbered = np.unique(dry, return_inverse=True)
    kept = Shape(shape.vertices[used], renumbered.reshape(-1, 3))
    return joined([kept, Shape(cut, np.arange(len(cut)).reshape(-1, 3))])


def _lone_corner_first(triangles: np.ndarray, lone: np.ndarray) -> np.ndarray:
    """Roll the corners of each triangle so that its one flagged corner comes first."""
    order = (np.argmax(lone, axis=1)[:, None] + np.arange(3)) % 3
    return triangles[np.arange(len(triangles))[:, None], order]


def _crossing(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Where the edges start -> end meet z = 0."""
    share = start[:, 2:] / (start[:, 2:] - end[:, 2:])
    crossing = start + share * (end - start)
    crossing[:, 2] = 0.0
    return crossing
