"""Training examples: a simulated cluster, its true pose, and the complete surface of its hull.

Everything that a network sees is made by the stage code of the service, so that training and serving cannot
drift apart.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shipshape.errors import Unprocessable
from shipshape.types import Contact, Pose, ReferenceBox
from shipshape.validation import ContactLimits, check_contact
from shipshape_lab.simulator.clusters import ClusterSet, Surfaces, load, load_surfaces

MIN_POINTS = 10
_MIRROR = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Example:
    """One cluster with its truth; level frame, metres, radians."""

    contact: Contact
    pose: Pose  # true heading, origin on the waterline, true size
    label: int  # index into the catalogue; len(catalogue) = not in it
    surface_level: np.ndarray  # complete outer surface above water, (S, 3) float32


class Examples:
    """A data set in memory, handed out example by example."""

    def __init__(self, clusters: ClusterSet, surfaces: Surfaces, *, catalogue_only: bool = False) -> None:
        self.clusters, self._surfaces = clusters, surfaces
        self._row = surfaces.index()
        self._boxes = np.concatenate(
            [np.ptp(surfaces.points[:, :, :2], axis=1), surfaces.points[:, :, 2:].max(axis=1)], axis=1
        )
        self.catalogue = clusters.vessels
        # The catalogue's names come first among the classes; all others are one, "unknown".
        self.labels = np.minimum(clusters.label, len(self.catalogue))
        usable = clusters.n >= MIN_POINTS
        self.indices = np.flatnonzero(usable & (self.labels < len(self.catalogue)) if catalogue_only else usable)

    @classmethod
    def read(cls, folder: Path, name: str, *, catalogue_only: bool = False) -> "Examples":
        """The set `name` of a data folder."""
        clusters, surfaces = load(folder / f"{name}.npz"), load_surfaces(folder / f"{name}_surfaces.npz")
        return cls(clusters, surfaces, catalogue_only=catalogue_only)

    def __len__(self) -> int:
        return len(self.indices)

    @property
    def boxes(self) -> list[ReferenceBox]:
        """Reference boxes of the catalogue, metres."""
        return [vessel.box for vessel in self.catalogue]

    def example(self, i: int) -> Example:
        """Cluster i of the set as it was scanned, sensor height known."""
        data = self.clusters
        row = self._row[data.name(i), int(data.hull_seed[i])]
        T_level_vessel = data.T_level_vessel[i]
        surface = self._surfaces.points[row] @ T_level_vessel[:3, :3].T + T_level_vessel[:3, 3]
        water = -float(data.sensor_height[i])
        x, y = T_level_vessel[:2, 3]
        return Example(
            Contact(data.cluster(i), sensor_height=float(data.sensor_height[i])),
            Pose(float(data.heading[i]), (float(x), float(y), water), ReferenceBox(*map(float, self._boxes[row]))),
            int(self.labels[i]),
            surface[surface[:, 2] >= water].astype(np.float32),
        )

    def drawn(self, i: int, rng: np.random.Generator) -> Example:
        """Cluster i as training sees it: mirrored or not, thinned or not, sensor height told or not."""
        example = self.example(i)
        if rng.random() < 0.5:
            example = mirrored(example)
        points = example.contact.points_level
        keep = rng.random(len(points)) >= rng.choice([0.0, 0.1, 0.3, 0.5], p=[0.5, 0.2, 0.2, 0.1])
        if np.count_nonzero(keep) >= MIN_POINTS:
            points = points[keep]
        height = example.contact.sensor_height if rng.random() < 0.5 else None
        return Example(Contact(points, sensor_height=height), example.pose, example.label, example.surface_level)


def is_accepted(contact: Contact) -> bool:
    """Whether the service would take the contact: a few far points may lie too close together for it."""
    try:
        check_contact(contact, ContactLimits())
    except Unprocessable:
        return False
    return True


def mirrored(example: Example) -> Example:
    """The same scene with port and starboard exchanged."""
    x, y, z = example.pose.origin_level
    mirror = _MIRROR.astype(np.float32)
    return Example(
        Contact(example.contact.points_level * mirror, sensor_height=example.contact.sensor_height),
        Pose(-example.pose.heading, (x, -y, z), example.pose.size),
        example.label,
        example.surface_level * mirror,
    )
