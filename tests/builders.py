"""Analytic hulls whose pose is known before any code of the product runs, noise, and stand-ins for networks."""

import math
from collections.abc import Callable

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from shipshape.onnx_model import OnnxModel
from shipshape.types import Contact, Pose, ReferenceBox

BOAT = ReferenceBox(length=12.0, beam=4.0, height=3.0)
ANGLES = st.floats(-math.pi, math.pi, allow_nan=False)
SIDES = ("bow", "stern", "port", "starboard", "deck")


class FakeModel(OnnxModel):
    """A network that is a Python function of its inputs."""

    def __init__(self, answer: Callable[..., list[np.ndarray]]) -> None:
        self._answer = answer

    def run(self, **inputs: np.ndarray) -> list[np.ndarray]:
        return self._answer(**inputs)


def constant(*outputs: np.ndarray) -> FakeModel:
    """A network that always answers the same, whatever it is shown."""
    return FakeModel(lambda **_: [np.asarray(output, np.float32) for output in outputs])


def properties(examples: int = 50) -> settings:
    """Property tests of this suite: the same examples in every run, and no stop-watch."""
    return settings(max_examples=examples, deadline=None, derandomize=True, database=None)


def box_faces(size: ReferenceBox, step: float = 0.25) -> dict[str, np.ndarray]:
    """Dense points of each face of a box hull, corners included, vessel frame, float32 (n, 3)."""
    x, y, z = (
        np.linspace(low, high, max(2, math.ceil((high - low) / step) + 1))
        for low, high in (
            (-size.length / 2, size.length / 2),
            (-size.beam / 2, size.beam / 2),
            (0.0, size.height),
        )
    )
    return {
        "bow": _grid(x[-1:], y, z),
        "stern": _grid(x[:1], y, z),
        "port": _grid(x, y[-1:], z),
        "starboard": _grid(x, y[:1], z),
        "deck": _grid(x, y, z[-1:]),
    }


def _grid(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)


def place(points_vessel: np.ndarray, pose: Pose) -> np.ndarray:
    """Vessel-frame points in the level frame, by complex numbers in float64: the product's code is not asked."""
    turned = (points_vessel[:, 0] + 1j * points_vessel[:, 1].astype(np.float64)) * np.exp(1j * pose.heading)
    x, y, z = pose.origin_level
    return np.column_stack([turned.real + x, turned.imag + y, points_vessel[:, 2] + z]).astype(np.float32)


def turn_level(points_level: np.ndarray, angle: float) -> np.ndarray:
    """The same points after the whole world turned by `angle` about the sensor."""
    return place(points_level, Pose(angle, (0.0, 0.0, 0.0), BOAT))


def whole_hull(pose: Pose, step: float = 0.25) -> np.ndarray:
    """Every face of a box hull, level frame."""
    return place(np.concatenate(list(box_faces(pose.size, step).values())), pose)


def seen_hull(pose: Pose, step: float = 0.25) -> np.ndarray:
    """The upright faces of a box hull that look at the sensor in the level frame's origin.

    A face is seen if its outward normal points to the side on which the sensor lies; no ray is cast.
    """
    faces = box_faces(pose.size, step)
    x, y, _ = pose.origin_level
    sensor = -(x + 1j * y) * np.exp(-1j * pose.heading)  # in the vessel frame
    half_length, half_beam = pose.size.length / 2, pose.size.beam / 2
    seen = {
        "bow": sensor.real > half_length,
        "stern": sensor.real < -half_length,
        "port": sensor.imag > half_beam,
        "starboard": sensor.imag < -half_beam,
    }
    return place(np.concatenate([faces[name] for name, looks in seen.items() if looks]), pose)


def noisy(points: np.ndarray, sd: float = 0.02, seed: int = 0) -> np.ndarray:
    """The points with range noise of a LiDAR."""
    return (points + np.random.default_rng(seed).normal(0.0, sd, points.shape)).astype(np.float32)


def random_points(count: int, seed: int, spread: float = 3.0) -> np.ndarray:
    """Points without any structure."""
    return np.random.default_rng(seed).uniform(-spread, spread, (count, 3)).astype(np.float32)


def contact_of(points_level: np.ndarray, **fields: float) -> Contact:
    """A contact of these points."""
    return Contact(np.ascontiguousarray(points_level, np.float32), **fields)


def axis_error_deg(found: float, true: float) -> float:
    """Difference of two headings modulo pi, degrees."""
    return abs(math.degrees(math.remainder(found - true, math.pi)))


def heading_error_deg(found: float, true: float) -> float:
    """Difference of two headings, degrees."""
    return abs(math.degrees(math.remainder(found - true, math.tau)))
