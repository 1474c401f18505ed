"""ModelNet40 shapes as the paper's first experiment takes them: aligned, standing upright, length along x.

The files hold 10,000 surface points a shape in the unit sphere, y up (ModelNet's terms: academic research only).
Their headings differ from shape to shape, so each is turned until its vertical plane of symmetry is y = 0; what
is longer across than along is then turned once more, but for airplanes, whose wings may span more than their
length. Which end is the front stays open.
"""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from shipshape import frames
from shipshape.types import Pose, ReferenceBox


class Split(StrEnum):
    """ModelNet40's official lists."""

    TRAIN = "train"
    TEST = "test"


# The paper's three kinds; of guitars and toilets only 4 and 5 are at hand, so bathtubs, a whole class, join them.
KINDS = ("airplane", "bathtub", "guitar", "toilet")
_RINGS, _AZIMUTHS, _BLUR = 24, 360, 2.0  # bins of the search for symmetry, and the spread of a point, bins
_WIDE = "airplane"  # the kind that may be wider than long


@dataclass(frozen=True)
class Shape:
    """One complete shape in its own frame: x along it, z up, z = 0 under the middle of its box; no unit."""

    name: str
    points: np.ndarray  # (n, 3) float32

    @property
    def kind(self) -> str:
        """Class of ModelNet40."""
        return _kind(self.name)

    @property
    def pose(self) -> Pose:
        """The frame that the points are in, with the box of the complete shape."""
        return Pose(0.0, (0.0, 0.0, 0.0), ReferenceBox(*map(float, np.ptp(self.points, axis=0))))

    @property
    def extent(self) -> float:
        """Its largest side: the length that becomes 1 in every score."""
        return float(np.ptp(self.points, axis=0).max())


def read_shapes(folder: Path, split: Split) -> list[Shape]:
    """All shapes of KINDS that an official list holds and the folder has, by name.

    Raises:
        FileNotFoundError: the folder has no point files or not that list.
    """
    files, names = sorted(folder.glob("modelnet40_*_int16.npz")), folder / f"modelnet40_{split}.txt"
    if not files or not names.exists():
        raise FileNotFoundError(
            f"expected modelnet40_*_int16.npz and {names.name} in {folder}, got {len(files)} point files"
        )
    listed, found = set(names.read_text().split()), dict[str, np.ndarray]()
    for file in files:
        with np.load(file, allow_pickle=False) as arrays:
            points = arrays["points_q"] * arrays["scale"]
            for name, shape in zip(arrays["names"].tolist(), points, strict=True):
                if name in listed and _kind(name) in KINDS:
                    found.setdefault(name, shape)
    return [Shape(name, standing(_lengthwise(_z_up(found[name]), _kind(name)))) for name in sorted(found)]


def standing(points: np.ndarray) -> np.ndarray:
    """The points moved so that the middle of their box is over the origin and the lowest lies at z = 0."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    return (points - [middle[0], middle[1], low[2]]).astype(np.float32)


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    """The points turned about the z axis, counter-clockwise from above, radians."""
    result = np.array(points)
    result[:, :2] = points[:, :2] @ frames.R_level_vessel(angle).T.astype(points.dtype)
    return result


def _kind(name: str) -> str:
    return name.rpartition("_")[0]


def _z_up(points: np.ndarray) -> np.ndarray:
    return np.stack([points[:, 2], points[:, 0], points[:, 1]], axis=1)


def _lengthwise(points: np.ndarray, kind: str) -> np.ndarray:
    """The points turned so that their best vertical plane of symmetry through the centroid is y = 0, or x = 0."""
    centred = points - points.mean(axis=0)
    symmetry = _symmetry(centred)
    along = turned(centred, -np.pi * (int(symmetry.argmax()) + 1) / len(symmetry))
    length, beam, _ = np.ptp(along, axis=0)
    return turned(along, np.pi / 2) if beam > length and kind != _WIDE else along


def _symmetry(centred: np.ndarray) -> np.ndarray:
    """How well points equal their mirror image in the vertical plane of azimuth pi (i + 1) / n, for each i of n.

    A mirror plane at azimuth a maps azimuth b to 2 a - b, so what is wanted is the convolution of the points'
    azimuth histogram with itself, summed over rings of distance and height.
    """
    x, y, z = centred.T
    ring = np.hypot(x, y)
    azimuth = np.arctan2(y, x) % (2 * np.pi)  # bin i + bin j = bin of the sum, its middle one further on
    bounds = ((0.0, ring.max()), (z.min(), z.max()), (0.0, 2 * np.pi))
    counts, _ = np.histogramdd(np.stack([ring, z, azimuth], axis=1), (_RINGS, _RINGS, _AZIMUTHS), bounds)
    waves = np.fft.rfft(gaussian_filter1d(np.sqrt(counts), _BLUR, axis=2, mode="wrap"), axis=2)
    return np.fft.irfft((waves**2).sum(axis=(0, 1)), _AZIMUTHS)
