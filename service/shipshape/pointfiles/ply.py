"""Polygon files: the vertices are the points, whatever else the file holds."""

import re
from collections.abc import Collection
from pathlib import Path

import numpy as np
from plyfile import PlyData

from shipshape.errors import FileError
from shipshape.pointfiles.clusters import Cluster
from shipshape.pointfiles.columns import cause, clusters_from_records, listed

_HEADER_BYTES = 64 * 2**10
_ELEMENT = re.compile(rb"^element\s+(\S+)\s+(\d+)\s*$", re.MULTILINE)


def read_ply(path: Path, max_bytes: int, id_names: Collection[str]) -> list[Cluster]:
    """The vertices of an ascii or binary .ply file; a cluster of each id where they have ids."""
    _check_counts(path)
    try:
        elements = {element.name: element for element in PlyData.read(str(path)).elements}
    except Exception as error:  # a damaged file makes the parser fail in ways of every kind
        raise FileError(f"expected {path.name} to be a complete PLY file, got: {cause(error)}") from error
    if "vertex" not in elements:
        raise FileError(f"expected an element vertex in {path.name}, got {listed(list(elements))}")
    return clusters_from_records(np.asarray(elements["vertex"].data), id_names, path.name)


def _check_counts(path: Path) -> None:
    """Refuse before anything is allocated: a row takes at least a byte, so a file cannot hold more rows."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        header = stream.read(_HEADER_BYTES).partition(b"end_header")[0]
    for name, count in _ELEMENT.findall(header):
        if int(count) > size:
            raise FileError(
                f"expected at most {size} rows of {name.decode(errors='replace')} in the {size} bytes "
                f"of {path.name}, got a header for {int(count)}"
            )
