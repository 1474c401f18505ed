"""One cluster of a file and the caller's name for it; files that name their clusters are split by that."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Shaped

from shipshape.errors import FileError

MAX_CLUSTERS = 100_000  # of one file; each costs memory of its own, however few points it has
ID_NAMES = ("contact_id", "track_id", "cluster_id", "contact", "track", "cluster")
NO_CLUSTER = {"", "-1", "nan"}  # ids of points that belong to none


@dataclass(frozen=True, slots=True)
class Cluster:
    """Points in the level frame, metres."""

    points_level: Float32[np.ndarray, "n 3"]
    contact_id: str = ""
    apart: bool = False  # the file itself says that this is one cluster and not a whole scan


def id_name(names: Collection[str], wanted: Collection[str]) -> str | None:
    """The first of the names `wanted` that is among `names`, whatever its capitals, as it is written there."""
    lower = {name.lower(): name for name in names}
    return next((lower[name.lower()] for name in wanted if name.lower() in lower), None)


def split_by_id(
    points_level: Float32[np.ndarray, "n 3"], ids: Shaped[np.ndarray, " n"] | None, what: str
) -> list[Cluster]:
    """A cluster of each id, in the order in which they first appear; points without one (empty, -1) are dropped.

    Raises:
        FileError: More clusters than a file may hold.
    """
    if ids is None:
        return [Cluster(points_level)]
    names, first, which = np.unique(ids, return_index=True, return_inverse=True)
    if len(names) > MAX_CLUSTERS:
        raise FileError(f"expected at most {MAX_CLUSTERS} clusters in {what}, got {len(names)}")
    order = np.argsort(which, kind="stable")
    parts = np.split(points_level[order], np.cumsum(np.bincount(which))[:-1])
    found = [Cluster(parts[index], id_text(names[index]), apart=True) for index in np.argsort(first)]
    return [cluster for cluster in found if cluster.contact_id not in NO_CLUSTER]


def id_text(value: object) -> str:
    """An id of a file as text; whole numbers that a format holds as floats are written as whole ones."""
    if value is None:
        return ""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace").strip()
    if isinstance(value, float | np.floating) and float(value).is_integer():
        return str(int(value))
    return str(value).strip()
