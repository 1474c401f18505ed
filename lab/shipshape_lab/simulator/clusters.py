"""Files of clusters and of complete surfaces: plain arrays in .npz, nothing pickled.

A cluster set holds M clusters one behind the other in `points`; `n` says how many points each has.
"""

import os
from collections.abc import Sequence
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import TypeVar

import numpy as np

from shipshape.bundle import CatalogueVessel
from shipshape.types import ReferenceBox
from shipshape_lab.simulator.catalogue import DEFAULT, Catalogue
from shipshape_lab.simulator.scan import Scan

NOMINAL_SEED = -1
OCCLUDED_FROM = 0.1  # share of the returns that something in front took away

Kind = TypeVar("Kind")


def _names(catalogue: Catalogue = DEFAULT) -> np.ndarray:
    return np.array(catalogue.names)


def _boxes(catalogue: Catalogue = DEFAULT) -> np.ndarray:
    return np.array([(box.length, box.beam, box.height) for box in catalogue.boxes()])


@dataclass(frozen=True)
class ClusterSet:
    """M clusters with their truth; metres and radians, level frame.

    Attributes:
        points: all clusters' points, shape (sum of n, 3), float32.
        n: points of each cluster, shape (M,), int32.
        label: index into `classes`, shape (M,), int32.
        classes: type names, those of the catalogue first, unicode.
        heading: yaw of the vessel, counter-clockwise, shape (M,), float64.
        range_m: horizontal distance to the vessel's origin, shape (M,), float64.
        bearing: direction of the vessel's origin, shape (M,), float64.
        aspect_deg: 0 bow-on to 180 stern-on, degrees, shape (M,), float64.
        sensor_height: height of the sensor above the waterline, shape (M,), float64.
        hull_seed: seed of the hull's variation, -1 for the nominal hull, shape (M,), int64.
        T_level_vessel: pose of the vessel, shape (M, 4, 4), float64.
        lidar: name of the sensor, unicode, shape (M,).
        seed: seed of the whole set, a scalar.
        catalogue: names of the K vessels to be known, unicode; the default ones if the file does not say.
        boxes: length, beam and air height of their nominal hulls, shape (K, 3), float64.
        hidden_share: share of the returns that occluders took away, 0 to 1, NaN if the file does not say, shape
            (M,), float64.
    """

    points: np.ndarray
    n: np.ndarray
    label: np.ndarray
    classes: np.ndarray
    heading: np.ndarray
    range_m: np.ndarray
    bearing: np.ndarray
    aspect_deg: np.ndarray
    sensor_height: np.ndarray
    hull_seed: np.ndarray
    T_level_vessel: np.ndarray
    lidar: np.ndarray
    seed: np.ndarray
    catalogue: np.ndarray = field(default_factory=_names)
    boxes: np.ndarray = field(default_factory=_boxes)
    hidden_share: np.ndarray = field(default_factory=lambda: np.zeros(0))
    starts: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "starts", np.concatenate([[0], np.cumsum(self.n, dtype=np.int64)]))
        if len(self.hidden_share) != len(self.n):
            object.__setattr__(self, "hidden_share", np.full(len(self.n), np.nan))

    def __len__(self) -> int:
        return len(self.n)

    def cluster(self, i: int) -> np.ndarray:
        """Points of cluster i in the level frame, shape (n[i], 3), float32."""
        i = range(len(self))[i]
        return self.points[self.starts[i] : self.starts[i + 1]]

    def name(self, i: int) -> str:
        """Type name of cluster i."""
        return str(self.classes[self.label[i]])

    @property
    def occluded(self) -> np.ndarray:
        """Whether something in front took away at least a tenth of the returns, shape (M,), bool."""
        return self.hidden_share >= OCCLUDED_FROM

    @property
    def vessels(self) -> tuple[CatalogueVessel, ...]:
        """The catalogue that the set was made from."""
        return _vessels(self.catalogue, self.boxes)


@dataclass(frozen=True)
class Surfaces:
    """Outer surfaces of H hulls: type names and seeds (H,), points (H, S, 3) in the vessel frame, float32."""

    name: np.ndarray
    hull_seed: np.ndarray
    points: np.ndarray

    def index(self) -> dict[tuple[str, int], int]:
        """Row of each (type name, hull seed)."""
        return {(str(n), int(s)): i for i, (n, s) in enumerate(zip(self.name, self.hull_seed, strict=True))}


def collect(scans: Sequence[tuple[Scan, str]], catalogue: Catalogue, seed: int) -> ClusterSet:
    """Packs scans, each with the name of its sensor, into one set; the catalogue's classes fix the labels."""
    found = [scan for scan, _ in scans]
    seeds = [NOMINAL_SEED if scan.vessel_seed is None else scan.vessel_seed for scan in found]
    return ClusterSet(
        points=np.concatenate([np.zeros((0, 3), np.float32), *(scan.points_level for scan in found)]),
        n=np.array([len(scan.points_level) for scan in found], np.int32),
        label=np.array([catalogue.classes.index(scan.vessel_name) for scan in found], np.int32),
        classes=np.array(catalogue.classes),
        heading=np.array([scan.heading for scan in found]),
        range_m=np.array([scan.range_m for scan in found]),
        bearing=np.array([scan.bearing for scan in found]),
        aspect_deg=np.array([scan.aspect_deg for scan in found]),
        sensor_height=np.array([scan.sensor_height for scan in found]),
        hull_seed=np.array(seeds, np.int64),
        T_level_vessel=np.array([scan.T_level_vessel for scan in found]).reshape(-1, 4, 4),
        lidar=np.array([name for _, name in scans], dtype="U16"),
        seed=np.array(seed, np.int64),
        catalogue=_names(catalogue),
        boxes=_boxes(catalogue),
        hidden_share=np.array([scan.hidden_share for scan in found], np.float64),
    )


def save(path: Path, content: ClusterSet | Surfaces) -> None:
    """Writes a set to `path`; a reader never sees half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.stem}.{os.getpid()}.npz")
    np.savez(draft, **{f.name: getattr(content, f.name) for f in fields(content) if f.init})
    draft.replace(path)


def load(path: str | Path) -> ClusterSet:
    """Reads a cluster set.

    Raises:
        ValueError: if the file is not a cluster set.
    """
    return _read(ClusterSet, path)


def load_catalogue(path: Path) -> tuple[CatalogueVessel, ...]:
    """The catalogue of a cluster set, without reading its clusters."""
    with np.load(path, allow_pickle=False) as arrays:
        if "catalogue" not in arrays:
            return DEFAULT.vessels()
        return _vessels(arrays["catalogue"], arrays["boxes"])


def _vessels(names: np.ndarray, boxes: np.ndarray) -> tuple[CatalogueVessel, ...]:
    return tuple(CatalogueVessel(str(n), ReferenceBox(*map(float, b))) for n, b in zip(names, boxes, strict=True))


def load_surfaces(path: str | Path) -> Surfaces:
    """Reads complete surfaces.

    Raises:
        ValueError: if the file holds no surfaces.
    """
    return _read(Surfaces, path)


def _read(kind: type[Kind], path: str | Path) -> Kind:
    wanted = [f for f in fields(kind) if f.init]
    with np.load(path, allow_pickle=False) as arrays:
        missing = sorted(f.name for f in wanted if f.name not in arrays and f.default_factory is MISSING)
        if missing:
            raise ValueError(f"{path} must hold the arrays of a {kind.__name__}, but lacks {missing}")
        return kind(**{f.name: arrays[f.name] for f in wanted if f.name in arrays})
