"""What the formats share: finding x, y and z, and refusing what is not a plain array of them."""

from collections.abc import Collection, Sequence

import numpy as np
from jaxtyping import Float32

from shipshape.errors import FileError
from shipshape.pointfiles.clusters import Cluster, id_name, split_by_id

AXES = ("x", "y", "z")


def clusters_from_records(records: np.ndarray, id_names: Collection[str], what: str) -> list[Cluster]:
    """The fields x, y and z of a structured array as clusters: one, or one of each id."""
    named = id_name(records.dtype.names or (), id_names)
    return split_by_id(xyz_from_records(records, what), None if named is None else records[named], what)


def xyz_from_records(records: np.ndarray, what: str) -> Float32[np.ndarray, "n 3"]:
    """The fields x, y and z of a structured array, as points."""
    dtype = records.dtype
    names = dtype.names or ()
    if not all(axis in names and dtype[axis].kind == "f" for axis in AXES):
        raise FileError(f"expected {what} to have the float fields x, y, z, got {described(dtype)}")
    return as_points(np.stack([records[axis] for axis in AXES], axis=-1), what)


def as_points(array: np.ndarray, what: str) -> Float32[np.ndarray, "n 3"]:
    """`array` as float32 points, when it is floats of shape (N, 3)."""
    if array.dtype.names:
        return xyz_from_records(array, what)
    if array.ndim != 2 or array.shape[1] != len(AXES) or array.dtype.kind != "f":
        raise FileError(f"expected {what} to be floats of shape (N, 3), got {array.dtype} of shape {array.shape}")
    with np.errstate(over="ignore"):  # what float32 cannot hold becomes infinite, which the pipeline refuses
        return np.ascontiguousarray(array, dtype=np.float32)


def described(dtype: np.dtype) -> str:
    """Field names and types of a structured dtype, for an error message."""
    if not dtype.names:
        return str(dtype)
    return listed([f"{name} {dtype[name]}" for name in dtype.names])


def listed(words: Sequence[str], most: int = 12, longest: int = 40) -> str:
    """The first words, comma-separated; a message must stay one readable sentence."""
    shown = ", ".join(word[:longest] for word in words[:most]) or "none"
    return shown if len(words) <= most else f"{shown} and {len(words) - most} more"


def cause(error: Exception) -> str:
    """The text of a library's exception, on one line and not too long."""
    text = " ".join(str(error).split()).rstrip(".")
    return text[:160] or type(error).__name__
