"""What requests hold: clusters of several sizes, in several lanes, each with its weight."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from shipshape.errors import FileError

Cluster = Float32[np.ndarray, "n 3"]
SCANS = 16  # different scans of each number of contacts
REPEATED_NOISE_M = 0.01  # of points that a cluster has not got, and that repeat one it has


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """The contacts of one request, metres, level frame; an empty lane is the target's default."""

    clusters: tuple[Cluster, ...]
    lane: str = ""

    @property
    def labels(self) -> tuple[str, ...]:
        """The groups in which it is counted apart."""
        count = len(self.clusters)
        size = f"{len(self.clusters[0])} points" if count == 1 else f"{count} contacts"
        return (size, f"lane {self.lane}") if self.lane else (size,)


@dataclass(frozen=True, slots=True)
class Mixture:
    """Clusters and lanes with their weights, which need not sum to 1."""

    clusters: Sequence[tuple[Cluster, float]]
    lanes: Mapping[str, float]

    def requests(self, contacts: int, rng: np.random.Generator) -> tuple[list[Request], list[float]]:
        """All requests of so many contacts, and the probability of each.

        One contact: each cluster in each lane. A scan: `SCANS` draws of clusters, each in each lane.
        """
        weights = np.array([weight for _, weight in self.clusters])
        weights = weights / weights.sum()
        if contacts == 1:
            scans = [
                ((cluster,), float(weight)) for (cluster, _), weight in zip(self.clusters, weights, strict=True)
            ]
        else:
            drawn = rng.choice(len(weights), (SCANS, contacts), p=weights)
            scans = [(tuple(self.clusters[index][0] for index in row), 1 / SCANS) for row in drawn]
        total = sum(self.lanes.values())
        pairs = [
            (Request(clusters, lane), share * weight / total)
            for clusters, share in scans
            for lane, weight in self.lanes.items()
        ]
        return [request for request, _ in pairs], [share for _, share in pairs]


def cut(
    clusters: Sequence[Cluster], sizes: Mapping[int, float], rng: np.random.Generator
) -> list[tuple[Cluster, float]]:
    """Each cluster in each of the sizes, points; no sizes: the clusters as they are, all alike.

    A cluster that is too small repeats its points, a centimetre off.

    Raises:
        FileError: There is no cluster, or one without points.
    """
    if not clusters or any(len(cluster) == 0 for cluster in clusters):
        raise FileError("expected clusters of one point or more, got none")
    if not sizes:
        return [(cluster, 1.0) for cluster in clusters]
    return [(_of_size(cluster, size, rng), weight) for size, weight in sizes.items() for cluster in clusters]


def _of_size(cluster: Cluster, size: int, rng: np.random.Generator) -> Cluster:
    if size <= len(cluster):
        return cluster[np.sort(rng.choice(len(cluster), size, replace=False))]
    repeated = cluster[rng.integers(len(cluster), size=size - len(cluster))]
    moved = repeated + rng.normal(0.0, REPEATED_NOISE_M, repeated.shape)
    return np.concatenate([cluster, moved]).astype(np.float32)
