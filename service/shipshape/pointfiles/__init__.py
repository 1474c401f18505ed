"""Files of clusters -> arrays of points, (N, 3) float32 in metres, level frame.

.npy             one cluster, (N, 3) floats or records with x, y, z
.npz             many clusters: `points` (sum N, 3) and `n`, the points of each
.csv .xyz        one cluster, a point a line; a header may name the columns x, y, z
.pcd             one cluster; ascii, binary or binary_compressed
.ply             one cluster, the vertices
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from shipshape.errors import FileError
from shipshape.pointfiles.arrays import read_npy, read_npz
from shipshape.pointfiles.pcd import read_pcd
from shipshape.pointfiles.ply import read_ply
from shipshape.pointfiles.text import read_text

MAX_BYTES = 512 * 2**20

_READERS: Mapping[str, Callable[[Path, int], list[Float32[np.ndarray, "_ 3"]]]] = {
    ".npy": read_npy,
    ".npz": read_npz,
    ".csv": read_text,
    ".xyz": read_text,
    ".pcd": read_pcd,
    ".ply": read_ply,
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
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise FileError(f"expected a file ending in {' '.join(SUFFIXES)}, got {path.name}")
    try:
        size = path.stat().st_size
        if not path.is_file() or not 0 < size <= max_bytes:
            came = f"{size} bytes" if path.is_file() else "something that is no file"
            raise FileError(f"expected {path.name} to hold 1 to {max_bytes} bytes, got {came}")
        return reader(path, max_bytes)
    except OSError as error:
        raise FileError(f"expected to read {path.name}, got: {error.strerror or error}") from error
