"""Point Cloud Data files, in all three encodings."""

import struct
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np
from pypcd4.pypcd4 import Encoding, MetaData, PointCloud

from shipshape.errors import FileError
from shipshape.pointfiles.clusters import Cluster
from shipshape.pointfiles.columns import cause, clusters_from_records

_MAX_HEADER_LINES = 64


def read_pcd(path: Path, max_bytes: int, id_names: Collection[str]) -> list[Cluster]:
    """The cluster of a .pcd file, or one of each id.

    NaN rows of an organised cloud are directions without a return.
    """
    try:
        _check_size(path, max_bytes)
        cloud = PointCloud.from_path(path)
    except FileError:
        raise
    except Exception as error:  # a damaged file makes the parser fail in ways of every kind
        raise FileError(f"expected {path.name} to be a complete PCD file, got: {_complaint(error)}") from error
    records = np.atleast_1d(cloud.pc_data)  # the parser returns a lone point without its axis
    if len(records) != cloud.metadata.points:
        raise FileError(
            f"expected the {cloud.metadata.points} points that {path.name} promises, got {len(records)}"
        )
    clusters = clusters_from_records(records, id_names, path.name)
    return [_returned(cluster) for cluster in clusters] if cloud.metadata.height > 1 else clusters


def _returned(cluster: Cluster) -> Cluster:
    points = cluster.points_level
    return replace(cluster, points_level=points[np.isfinite(points).all(axis=1)])


def _check_size(path: Path, max_bytes: int) -> None:
    """Refuse before anything is allocated: the header may promise any number of points."""
    metadata, offset = _read_header(path)
    row = sum(size * count for size, count in zip(metadata.size, metadata.count, strict=True))
    needed = metadata.points * row
    if metadata.data == Encoding.BINARY_COMPRESSED and metadata.points:
        with path.open("rb") as stream:
            stream.seek(offset)
            _, unpacked = struct.unpack("<II", stream.read(8))
        needed = max(needed, unpacked)
    if needed > max_bytes:
        raise FileError(f"expected {path.name} to unpack to at most {max_bytes} bytes, got {needed}")


def _read_header(path: Path) -> tuple[MetaData, int]:
    """The parsed header, and where the data begin."""
    lines = []
    with path.open("rb") as stream:
        for _ in range(_MAX_HEADER_LINES):
            line = stream.readline(1024).decode("utf-8").strip()
            lines.append(line)
            if line.startswith("DATA"):
                return MetaData.parse_header(lines), stream.tell()
    raise FileError(f"expected a PCD header that ends in a DATA line in {path.name}, got none")


def _complaint(error: Exception) -> str:
    return "a damaged header" if hasattr(error, "errors") else cause(error)
