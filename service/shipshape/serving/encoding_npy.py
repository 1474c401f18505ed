"""A NumPy .npy file -> points: what `np.save` writes of an (n, 3) array, or of records with fields x, y and z.

Versions 1 to 3; float16, float32 or float64 of either byte order; C or Fortran order; other fields are ignored.
Nothing is unpickled, and nothing is allocated before the header's shape is known to be the body's length.
"""

import io
import math

import numpy as np
from jaxtyping import Float32
from numpy.lib import format as npy

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import Limits, check_points, to_float32

MAX_HEADER_BYTES = 4096  # np.save needs 128 for plain arrays and some hundred for records of many fields
FLOAT_BYTES = (2, 4, 8)
# The header of version 3 differs from that of 2 only in how field names beyond ASCII are read; x, y, z are within.
_READERS = {
    (1, 0): npy.read_array_header_1_0,
    (2, 0): npy.read_array_header_2_0,
    (3, 0): npy.read_array_header_2_0,
}


def points_from_npy(body: bytes, limits: Limits) -> Float32[np.ndarray, "n 3"]:
    """The points of a .npy file, level frame, metres; what is not finite passes: the pipeline refuses it.

    Raises:
        InvalidInput: Not a .npy file, another shape or kind of number, or not as many bytes as its header says.
        TooLarge: More points than the limit.
    """
    stream = io.BytesIO(body)
    shape, fortran_order, dtype = _header(stream)
    start = stream.tell()
    _check_form(shape, dtype)
    check_points(shape[0], limits)
    expected = math.prod(shape) * dtype.itemsize
    if len(body) - start != expected:
        raise InvalidInput(f"expected {expected} bytes after the .npy header, got {len(body) - start}")
    array: np.ndarray = np.ndarray(shape, dtype, body, start, order="F" if fortran_order else "C")
    return to_float32(array if dtype.names is None else np.column_stack([array[axis] for axis in "xyz"]))


def _header(stream: io.BytesIO) -> tuple[tuple[int, ...], bool, np.dtype]:
    try:
        version = npy.read_magic(stream)
        shape, fortran_order, dtype = _READERS[version](stream, max_header_size=MAX_HEADER_BYTES)
    except Exception as error:  # a hostile header makes its readers raise nearly anything
        raise InvalidInput(
            f"expected a .npy file of version 1 to 3 with a header of at most {MAX_HEADER_BYTES} bytes, "
            "got something else"
        ) from error
    return shape, fortran_order, dtype


def _check_form(shape: tuple[int, ...], dtype: np.dtype) -> None:
    if any(length < 0 for length in shape):
        raise InvalidInput(f"expected a .npy array of shape (n, 3), got {shape!s:.80}")
    if dtype.names is None:
        numbers = {dtype}
        if len(shape) != 2 or shape[1] != 3:
            raise InvalidInput(f"expected a .npy array of shape (n, 3), or records x, y, z, got {shape!s:.80}")
    else:
        numbers = {dtype[axis] for axis in "xyz" if axis in dtype.names}
        if len(shape) != 1 or not set("xyz") <= set(dtype.names):
            raise InvalidInput(
                f"expected .npy records of shape (n,) with fields x, y and z, "
                f"got shape {shape!s:.80} and fields {', '.join(dtype.names):.80}"
            )
    if any(number.kind != "f" or number.itemsize not in FLOAT_BYTES for number in numbers):
        got = " and ".join(sorted(map(str, numbers)))
        raise InvalidInput(f"expected float16, float32 or float64 in a .npy array, got {got:.80}")
