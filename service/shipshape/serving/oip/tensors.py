"""Tensors of the Open Inference Protocol: checked against what was asked for, from and to their bytes.

Raw data is row-major and little-endian; each element of BYTES follows its length, 4 bytes little-endian.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import chain
from typing import Any

import numpy as np
from jaxtyping import Float64, Int32, Shaped

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import to_float

Values = Shaped[np.ndarray, " n"] | list[bytes]
LENGTH = struct.Struct("<I")


class Datatype(StrEnum):
    """The protocol's data types that the convention uses."""

    BOOL = "BOOL"
    INT32 = "INT32"
    FP32 = "FP32"
    FP64 = "FP64"
    BYTES = "BYTES"


NUMPY = {
    Datatype.BOOL: np.dtype("?"),
    Datatype.INT32: np.dtype("<i4"),
    Datatype.FP32: np.dtype("<f4"),
    Datatype.FP64: np.dtype("<f8"),
}


@dataclass(frozen=True, slots=True)
class TensorSpec:
    """What a tensor must look like; -1 in the shape stands for any number."""

    name: str
    datatype: Datatype
    shape: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)  # holds arrays: only identity is meant
class Tensor:
    """A tensor with its elements in row-major order, one after the other."""

    spec: TensorSpec
    shape: tuple[int, ...]
    values: Values


def from_raw(spec: TensorSpec, shape: tuple[int, ...], raw: bytes) -> Tensor:
    """The tensor of raw data.

    Raises:
        InvalidInput: More or fewer bytes than its shape says.
    """
    if spec.datatype is Datatype.BYTES:
        return Tensor(spec, shape, _split(spec, math.prod(shape), raw))
    expected = math.prod(shape) * NUMPY[spec.datatype].itemsize
    if len(raw) != expected:
        raise InvalidInput(f"expected {expected} bytes of input {spec.name}, got {len(raw)}")
    return Tensor(spec, shape, np.frombuffer(raw, NUMPY[spec.datatype]))


def from_values(spec: TensorSpec, shape: tuple[int, ...], values: Sequence[Any]) -> Tensor:
    """The tensor of listed elements, whose types are right; None stands for NaN.

    Raises:
        InvalidInput: More or fewer than its shape says, or integers that its type does not hold.
    """
    if len(values) != math.prod(shape):
        raise InvalidInput(f"expected {math.prod(shape)} elements of input {spec.name}, got {len(values)}")
    if spec.datatype is Datatype.BYTES:
        return Tensor(spec, shape, list(values))
    if spec.datatype is Datatype.INT32:
        return Tensor(spec, shape, _integers(spec, values))
    with np.errstate(over="ignore"):  # beyond float32 is infinite, which the pipeline refuses
        return Tensor(spec, shape, _floats(values).astype(NUMPY[spec.datatype]))


def to_raw(tensor: Tensor) -> bytes:
    """The raw data of a tensor."""
    if isinstance(tensor.values, list):
        return b"".join(chain.from_iterable((LENGTH.pack(len(item)), item) for item in tensor.values))
    return tensor.values.astype(NUMPY[tensor.spec.datatype], copy=False).tobytes()


def _split(spec: TensorSpec, count: int, raw: bytes) -> list[bytes]:
    items: list[bytes] = []
    at = 0
    while len(items) < count and at + LENGTH.size <= len(raw):
        (length,) = LENGTH.unpack_from(raw, at)
        at += LENGTH.size + length
        items.append(raw[at - length : at])
    if len(items) != count or at != len(raw):
        raise InvalidInput(
            f"expected {count} elements of input {spec.name}, each after its length in 4 bytes, "
            f"got {len(raw)} bytes that are not"
        )
    return items


def _integers(spec: TensorSpec, values: Sequence[int]) -> Int32[np.ndarray, " n"]:
    try:
        return np.asarray(values, NUMPY[spec.datatype])
    except OverflowError as error:
        raise InvalidInput(f"expected integers of 32 bits in input {spec.name}, got a larger one") from error


def _floats(values: Sequence[int | float | None]) -> Float64[np.ndarray, " n"]:
    try:
        return np.asarray(values, np.float64)
    except OverflowError:  # an integer beyond float64
        return np.asarray([math.nan if value is None else to_float(value) for value in values], np.float64)
