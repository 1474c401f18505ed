"""Primitive shapes, metres, vessel frame: lofts, blocks, rods, tubes, balls."""

import numpy as np

from shipshape_lab.simulator.vessels.shape import Shape

_UP = np.array([0.0, 0.0, 1.0])


def grid_faces(rows: int, columns: int, *, closed: bool = False) -> np.ndarray:
    """Two triangles for every cell of a (rows, columns) vertex grid; `closed` joins last column to first."""
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns - (not closed)), indexing="ij")
    here, right = row * columns + column, row * columns + (column + 1) % columns
    above, diagonal = here + columns, right + columns
    return np.stack([here, right, diagonal, here, diagonal, above], axis=-1).reshape(-1, 3)


def loft(rings: np.ndarray, *, capped: bool = True) -> Shape:
    """Skin stretched over closed rings.

    Args:
        rings: (k, n, 3) metres; k rings of n points, counter-clockwise about the direction they progress in.
        capped: close the first and the last ring, which must then be convex.

    Returns:
        The skin, facing outwards.
    """
    count, size = rings.shape[:2]
    faces = [grid_faces(count, size, closed=True)]
    if capped:
        fan = np.stack([np.zeros(size - 2, int), np.arange(1, size - 1), np.arange(2, size)], axis=1)
        faces += [fan[:, ::-1], fan + (count - 1) * size]
    return Shape(rings.reshape(-1, 3), np.concatenate(faces))


def block(length: float, width: float, height: float, *, chamfer: float = 0.0) -> Shape:
    """A box standing on z = 0, centred in x and y, its top `chamfer` metres smaller on every side."""
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    foot = np.array([length, width]) / 2
    rings = np.zeros((2, 4, 3))
    rings[0, :, :2] = corners * foot
    rings[1, :, :2] = corners * np.maximum(foot - chamfer, 0.01)
    rings[1, :, 2] = height
    return loft(rings)


def rods(segments: np.ndarray, radius: float, *, sides: int = 4) -> Shape:
    """Straight capped rods, one for each segment.

    Args:
        segments: (n, 2, 3) metres, both ends of every rod.
        radius: metres.
        sides: corners of the cross-section.

    Returns:
        All rods as one shape.
    """
    segments = np.asarray(segments, float).reshape(-1, 2, 3)
    axis = segments[:, 1] - segments[:, 0]
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-9)
    circles = segments[:, :, None] + radius * _circle(axis, sides)[:, None]
    one = loft(np.zeros((2, sides, 3))).faces
    faces = (one[None] + np.arange(len(segments))[:, None, None] * 2 * sides).reshape(-1, 3)
    return Shape(circles.reshape(-1, 3), faces)


def rod(
    start: tuple[float, float, float], end: tuple[float, float, float], radius: float, sides: int = 6
) -> Shape:
    """One straight capped rod between two points, metres."""
    return rods(np.array([[start, end]]), radius, sides=sides)


def tube(path: np.ndarray, radii: np.ndarray | float, *, sides: int = 8) -> Shape:
    """A capped tube bent along a path.

    Args:
        path: (n, 3) metres, no two neighbours equal.
        radii: (n,) or one number, metres.
        sides: corners of the cross-section.

    Returns:
        The tube as one shape.
    """
    axis = np.gradient(path, axis=0)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    radii = np.broadcast_to(np.asarray(radii, float), len(path))
    return loft(path[:, None] + radii[:, None, None] * _circle(axis, sides))


def cone(foot: float, top: float, height: float, *, sides: int = 10) -> Shape:
    """An upright cylinder or cone frustum on z = 0; radii at foot and top, metres."""
    path = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, height]])
    return tube(path, np.array([foot, top]), sides=sides)


def ball(radius: float, *, stretch: float = 1.0) -> Shape:
    """A faceted ball about the origin, its height `stretch` times its width."""
    polar = np.linspace(-0.49, 0.49, 6) * np.pi
    path = np.stack([np.zeros(6), np.zeros(6), stretch * radius * np.sin(polar)], axis=1)
    return tube(path, radius * np.cos(polar), sides=8)


def _circle(axis: np.ndarray, sides: int) -> np.ndarray:
    """Unit circles (n, sides, 3) across each of n unit axes, turned so that flats lie level."""
    upright = np.abs(axis @ _UP) > 0.9
    reference = np.where(upright[:, None], np.array([1.0, 0.0, 0.0]), _UP)
    first = np.cross(reference, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(axis, first)
    angle = (np.arange(sides) + 0.5) / sides * 2 * np.pi
    return first[:, None] * np.cos(angle)[:, None] + second[:, None] * np.sin(angle)[:, None]
