"""The paper's four masks: stain, single side, centre and random, at 30, 50, 70 and 90 % loss.

The paper's section 4.1.1 masks the point cloud, before any image is made ("applying four types of masks to
intentionally remove or occlude parts of the point cloud"), so every image method starts from the same points.
It shows the masks in a figure only; how each is drawn here is our reading of their names. A mask is a score for
each point: those with the lowest scores are lost, as many as the rate says.
"""

import zlib
from collections.abc import Callable
from types import MappingProxyType

import numpy as np
from scipy.spatial.distance import cdist

RATES = (30, 50, 70, 90)  # percent of the points lost
_STAINS = 6


def _stain(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Squared distance to the nearest of some blobs about points of the shape, in units of each blob's size."""
    centres = points[rng.integers(len(points), size=_STAINS)]
    sizes = rng.uniform(0.4, 1.0, _STAINS).astype(np.float32)
    return (cdist(points, centres, "sqeuclidean") / sizes**2).min(axis=1)


def _single_side(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Place along a random horizontal direction: one half-space is lost."""
    angle = rng.uniform(0.0, 2 * np.pi)
    return points[:, :2] @ np.array([np.cos(angle), np.sin(angle)])


def _centre(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Distance to the middle of the shape's box, shifted by up to a tenth of its sides."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    middle += rng.uniform(-0.1, 0.1, 3) * np.ptp(points, axis=0)
    return cdist(points, middle[None])[:, 0]


def _random(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return rng.random(len(points))


MASKS: MappingProxyType[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = MappingProxyType(
    {"stain": _stain, "single_side": _single_side, "centre": _centre, "random": _random}
)


def kept(points: np.ndarray, mask: str, rate: float, rng: np.random.Generator) -> np.ndarray:
    """Which points (n, 3) a mask of MASKS leaves at `rate` percent loss, (n,) bool; at least one is left."""
    lost = min(round(len(points) * rate / 100), len(points) - 1)
    left = np.ones(len(points), np.bool_)
    left[np.argpartition(MASKS[mask](points, rng), lost)[:lost]] = False
    return left


def chance(name: str, mask: str, rate: int, seed: int) -> np.random.Generator:
    """The random numbers of one masked test shape: the same for every method, and in every run."""
    return np.random.default_rng([seed, zlib.crc32(f"{name} {mask}".encode()), rate])
