"""Bytes, base64 or rows of numbers -> contacts, within limits, for every door alike.

Packed points are little-endian float32 x y z, 12 bytes a point, metres, level frame.
"""

import base64
import binascii
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np
from jaxtyping import Float32

from shipshape.errors import InvalidInput, TooLarge
from shipshape.executor import Lane
from shipshape.types import Contact, Options

POINT_BYTES = 12
PACKED = np.dtype("<f4")
MAX_ID_LENGTH = 256


@dataclass(frozen=True, slots=True)
class Limits:
    """What one request may bring."""

    max_body_bytes: int = 16 * 2**20
    max_points: int = 65536  # of one contact
    max_contacts: int = 256  # of one scan


@dataclass(frozen=True, slots=True)
class Wishes:
    """How a caller wants its contacts computed, and what it wants in the answer."""

    options: Options = field(default_factory=Options)
    lane: Lane = Lane.TRACKING
    captured_at: float | None = None  # seconds since 1970 (UTC) at which the LiDAR saw the contacts
    max_age_s: float | None = None  # an answer is worth nothing when what it tells is older; needs captured_at
    bundle: str = ""  # name or digest that the caller insists on; empty: whichever runs
    restored: bool = False
    images: bool = False
    png: bool = False


def make_wishes(*, captured_at: float | None, max_age_ms: float | None, **wishes: Any) -> Wishes:
    """Wishes; the others as they are.

    Raises:
        InvalidInput: A moment or an age that is no number, or an age that is not above 0.
    """
    if captured_at is not None and not math.isfinite(captured_at):
        raise InvalidInput(f"expected captured_at in seconds since 1970, got {captured_at}")
    if max_age_ms is not None and not 0 < max_age_ms < math.inf:
        raise InvalidInput(f"expected max_age_ms above 0, got {max_age_ms}")
    return Wishes(captured_at=captured_at, max_age_s=None if max_age_ms is None else max_age_ms / 1e3, **wishes)


def points_from_bytes(packed: bytes, limits: Limits) -> Float32[np.ndarray, "n 3"]:
    """Packed points, level frame, metres.

    Raises:
        InvalidInput: The length is no multiple of 12 bytes.
        TooLarge: More points than the limit.
    """
    if len(packed) % POINT_BYTES:
        raise InvalidInput(
            f"expected {POINT_BYTES} bytes a point (little-endian float32 x, y, z), "
            f"got {len(packed)} bytes, {len(packed) % POINT_BYTES} too many for whole points"
        )
    check_points(len(packed) // POINT_BYTES, limits)
    return np.frombuffer(packed, PACKED).reshape(-1, 3).astype(np.float32)


def points_from_base64(text: str, limits: Limits) -> Float32[np.ndarray, "n 3"]:
    """Packed points in base64; raises as `points_from_bytes` does."""
    try:
        packed = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise InvalidInput(f"expected base64 in points_base64, got text that is not: {error}") from error
    return points_from_bytes(packed, limits)


def points_from_rows(rows: Any, limits: Limits) -> Float32[np.ndarray, "n 3"]:
    """Rows of three numbers, level frame, metres. What is not finite in float32 passes: the pipeline refuses it.

    Raises:
        InvalidInput: Not rows of three numbers each.
        TooLarge: More points than the limit.
    """
    if not isinstance(rows, list):
        raise InvalidInput(f"expected points to be a list of [x, y, z], got {_kind(rows)}")
    check_points(len(rows), limits)
    if not rows:
        return np.empty((0, 3), np.float32)
    for index, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != 3:
            raise InvalidInput(f"expected three numbers in points[{index}], got {_kind(row)}")
    return _numbers(rows)


def make_contact(
    points_level: Float32[np.ndarray, "n 3"],
    *,
    contact_id: str = "",
    sensor_height_m: float | None = None,
    own_true_heading_deg: float | None = None,
) -> Contact:
    """The contact; whether its numbers can be true is the pipeline's to check.

    Raises:
        InvalidInput: An id too long.
    """
    if len(contact_id) > MAX_ID_LENGTH:
        raise InvalidInput(f"expected at most {MAX_ID_LENGTH} characters in contact_id, got {len(contact_id)}")
    return Contact(points_level, contact_id, sensor_height_m, own_true_heading_deg)


def check_body(size: int, limits: Limits) -> None:
    """Raises TooLarge when `size` bytes of a request are over the limit."""
    if size > limits.max_body_bytes:
        raise TooLarge(f"expected at most {limits.max_body_bytes} bytes a request, got {size} or more")


def check_contacts(count: int, limits: Limits) -> None:
    """Raises InvalidInput for a scan of none, TooLarge for one over the limit."""
    if count == 0:
        raise InvalidInput(f"expected 1 to {limits.max_contacts} contacts in a scan, got none")
    if count > limits.max_contacts:
        raise TooLarge(f"expected at most {limits.max_contacts} contacts in a scan, got {count}")


def check_points(count: int, limits: Limits) -> None:
    """Raises TooLarge when a contact of `count` points is over the limit."""
    if count > limits.max_points:
        raise TooLarge(f"expected at most {limits.max_points} points in a contact, got {count}")


def pack(points: Float32[np.ndarray, "n 3"]) -> bytes:
    """The inverse of `points_from_bytes`."""
    return points.astype(PACKED).tobytes()


def to_float32(array: np.ndarray) -> Float32[np.ndarray, "..."]:
    """A copy in float32; what lies beyond is infinite, which the pipeline refuses."""
    with np.errstate(over="ignore", invalid="ignore"):
        return array.astype(np.float32, order="C")


def flat_scores(scores: Mapping[str, Any], prefix: str = "") -> dict[str, float]:
    """The numbers in a nested table of scores, under dotted names."""
    flat: dict[str, float] = {}
    for name, value in scores.items():
        if isinstance(value, Mapping):
            flat |= flat_scores(value, f"{prefix}{name}.")
        elif isinstance(value, int | float):
            flat[f"{prefix}{name}"] = float(value)
    return flat


def _numbers(rows: list[list[Any]]) -> Float32[np.ndarray, "n 3"]:
    # By type, not by what numpy makes of it: true and false would become 1 and 0 among numbers.
    if not set(map(type, chain.from_iterable(rows))) <= {int, float}:
        raise InvalidInput("expected only numbers in points, got something else among them")
    try:
        array = np.asarray(rows, np.float64)
    except OverflowError:  # an integer beyond float64
        array = np.asarray([[to_float(number) for number in row] for row in rows], np.float64)
    return to_float32(array)


def to_float(number: int | float) -> float:
    """A number of JSON, whose integers have no end; beyond float64 they are infinite."""
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf


def _kind(value: Any) -> str:
    names = {type(None): "null", bool: "true or false", str: "a string", dict: "an object"}
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return names.get(type(value), "a number")
