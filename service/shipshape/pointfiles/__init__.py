"""Files of clusters -> arrays of points, (N, 3) float32 in metres, level frame.

.npy             one cluster, (N, 3) floats or records with x, y, z
.npz             many clusters: `points` (sum N, 3) and `n`, the points of each
.csv .xyz        one cluster, a point a line; a header may name the columns x, y, z
.pcd             one cluster; ascii, binary or binary_compressed
.ply             one cluster, the vertices
.las .laz        one cluster, any point format
.parquet         a point a row, or a cluster a row: x, y and z are lists then

A file may name its clusters: a field, column or array of one of `ID_NAMES` holds the id of each point (of each
cluster in .npz and lists), and points of one id are one cluster. LAS and Parquet need the extra shipshape[batch].
"""

from collections.abc import Callable, Collection, Mapping
from importlib import import_module
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from shipshape.errors import FileError
from shipshape.pointfiles.arrays import read_npy, read_npz
from shipshape.pointfiles.clusters import ID_NAMES, Cluster
from shipshape.pointfiles.pcd import read_pcd
from shipshape.pointfiles.ply import read_ply
from shipshape.pointfiles.text import read_text

MAX_BYTES = 512 * 2**20

_Reader = Callable[[Path, int, Collection[str]], list[Cluster]]


def _of_the_extra(module: str, reader: str) -> _Reader:
    """A reader whose libraries are imported when it is first used."""

    def read(path: Path, max_bytes: int, id_names: Collection[str]) -> list[Cluster]:
        """As the reader of that name."""
        try:
            found: _Reader = getattr(import_module(f"shipshape.pointfiles.{module}"), reader)
        except ModuleNotFoundError as error:
            raise FileError(
                f"expected the libraries of the extra shipshape[batch] to read {path.name}, got no {error.name}"
            ) from error
        return found(path, max_bytes, id_names)

    return read


_READERS: Mapping[str, _Reader] = {
    ".npy": read_npy,
    ".npz": read_npz,
    ".csv": read_text,
    ".xyz": read_text,
    ".pcd": read_pcd,
    ".ply": read_ply,
    ".las": _of_the_extra("las", "read_las"),
    ".laz": _of_the_extra("las", "read_las"),
    ".parquet": _of_the_extra("parquet", "read_parquet"),
}
SUFFIXES = tuple(_READERS)


def read_clusters(path: Path, max_bytes: int = MAX_BYTES) -> list[Float32[np.ndarray, "_ 3"]]:
    """The clusters in a file, in its order; NaN is left for the pipeline to refuse.

    Args:
        path: The file; its suffix says the format.
        max_bytes: Limit on the file and on what it unpacks to.

    Raises:
        FileError: One sentence that says what was expected and what came.
    """
    return [cluster.points_level for cluster in read_named_clusters(path, max_bytes)]


def read_named_clusters(
    path: Path, max_bytes: int = MAX_BYTES, id_names: Collection[str] = ID_NAMES
) -> list[Cluster]:
    """The clusters in a file and their ids; arguments and errors as those of `read_clusters`.

    Args:
        path: The file.
        max_bytes: Limit on the file and on what it unpacks to.
        id_names: Names that a column of ids may have, the first that is there counts.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise FileError(f"expected a file ending in {' '.join(SUFFIXES)}, got {path.name}")
    try:
        size = path.stat().st_size
        if not path.is_file() or not 0 < size <= max_bytes:
            came = f"{size} bytes" if path.is_file() else "something that is no file"
            raise FileError(f"expected {path.name} to hold 1 to {max_bytes} bytes, got {came}")
        return reader(path, max_bytes, id_names)
    except OSError as error:
        raise FileError(f"expected to read {path.name}, got: {error.strerror or error}") from error
