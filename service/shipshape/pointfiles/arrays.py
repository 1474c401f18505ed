"""NumPy files: .npy is one cluster, .npz many; no pickles, and no memory taken before its size is known."""

import io
import math
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from shipshape.errors import FileError
from shipshape.pointfiles.clusters import MAX_CLUSTERS, Cluster, id_name, id_text
from shipshape.pointfiles.columns import as_points, cause, clusters_from_records, listed

_HEADER_BYTES = 4096

_NPZ_ERRORS = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError)


def read_npy(path: Path, max_bytes: int, id_names: Collection[str]) -> list[Cluster]:
    """The cluster of a .npy file, (N, 3) floats or records with the fields x, y, z; or one of each id."""
    with path.open("rb") as stream:
        array = _read_array(stream, path.stat().st_size, path.name)
    if array.dtype.names:
        return clusters_from_records(array, id_names, path.name)
    return [Cluster(as_points(array, path.name))]


def read_npz(path: Path, max_bytes: int, id_names: Collection[str]) -> list[Cluster]:
    """The clusters of a .npz file with the arrays `points` (sum N, 3) and `n`, the points of each cluster.

    An array of their ids may be there too.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist()]
            if not {"points", "n"} <= set(names):
                raise FileError(f"expected the arrays points and n in {path.name}, got {listed(names)}")
            n = _read_counts(archive, path.name)
            points = as_points(_read_member(archive, "points", max_bytes), f"points in {path.name}")
            named = id_name(names, id_names)
            ids = None if named is None else _read_member(archive, named, max_bytes)
    except _NPZ_ERRORS as error:
        raise FileError(f"expected {path.name} to be a complete .npz file, got: {cause(error)}") from error
    clouds = _split(points, n, path.name)
    texts = [""] * len(clouds) if ids is None else [id_text(value) for value in ids.reshape(-1)]
    if len(texts) != len(clouds):
        raise FileError(f"expected {len(clouds)} ids in {named} of {path.name}, one a cluster, got {len(texts)}")
    return [Cluster(cloud, text, apart=True) for cloud, text in zip(clouds, texts, strict=True)]


def _read_member(archive: zipfile.ZipFile, name: str, max_bytes: int) -> np.ndarray:
    size = archive.getinfo(f"{name}.npy").file_size
    if size > max_bytes:
        raise FileError(f"expected {name} to unpack to at most {max_bytes} bytes, got {size}")
    # zipfile never unpacks more than the size stated here.
    return _read_array(io.BytesIO(archive.read(f"{name}.npy")), size, name)


def _read_array(stream: io.BufferedIOBase, size: int, what: str) -> np.ndarray:
    """The array in `stream` of `size` bytes, its header checked against the size first."""
    try:
        shape, dtype = _read_header(stream)
        promised, present = math.prod(shape) * dtype.itemsize, size - stream.tell()
        if dtype.hasobject or promised != present:
            came = (
                "pickled objects" if dtype.hasobject else f"a header for {promised} bytes with {present} behind it"
            )
            raise FileError(f"expected {what} to be a complete plain array, got {came}")
        stream.seek(0)
        return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))
    except (ValueError, TypeError, SyntaxError, EOFError) as error:
        raise FileError(f"expected {what} to be a NumPy array, got: {cause(error)}") from error


def _read_header(stream: io.BufferedIOBase) -> tuple[tuple[int, ...], np.dtype]:
    major, _ = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if major == 1 else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    return shape, dtype


def _read_counts(archive: zipfile.ZipFile, what: str) -> np.ndarray:
    """The points of each cluster; refused by their number before they are unpacked."""
    size = archive.getinfo("n.npy").file_size
    if size > 8 * MAX_CLUSTERS + _HEADER_BYTES:
        raise FileError(f"expected at most {MAX_CLUSTERS} clusters in {what}, got an n of {size} bytes")
    n = _read_array(io.BytesIO(archive.read("n.npy")), size, "n")
    if n.size > MAX_CLUSTERS:
        raise FileError(f"expected at most {MAX_CLUSTERS} clusters in {what}, got {n.size}")
    return n


def _split(points: Float32[np.ndarray, "total 3"], n: np.ndarray, what: str) -> list[Float32[np.ndarray, "_ 3"]]:
    expected = f"expected n in {what} to be whole numbers above 0 that sum to the {len(points)} points"
    if n.ndim != 1 or n.dtype.kind not in "iu":
        raise FileError(f"{expected}, got {n.dtype} of shape {n.shape}")
    if n.size and not 1 <= n.min() <= n.max() <= len(points):
        raise FileError(f"{expected}, got numbers from {n.min()} to {n.max()}")
    total = int(n.sum(dtype=np.int64))  # cannot wrap: at most MAX_CLUSTERS numbers, none above the points
    if total != len(points):
        raise FileError(f"{expected}, got {n.dtype} of shape {n.shape} and sum {total}")
    return np.split(points, np.cumsum(n, dtype=np.int64)[:-1]) if n.size else []
