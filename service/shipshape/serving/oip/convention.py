"""The convention for clusters of any size: which tensors make contacts. docs/oip.md explains it to callers."""

from collections.abc import Container, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float32, Int

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import Limits, check_contacts, make_contact, points_from_bytes
from shipshape.serving.oip.tensors import Datatype, Tensor, TensorSpec
from shipshape.types import Contact

POINTS = TensorSpec("points", Datatype.FP32, (-1, 3))
COUNTS = TensorSpec("counts", Datatype.INT32, (-1,))
SENSOR_HEIGHT = TensorSpec("sensor_height_m", Datatype.FP64, (-1,))
OWN_HEADING = TensorSpec("own_true_heading_deg", Datatype.FP64, (-1,))
CONTACT_ID = TensorSpec("contact_id", Datatype.BYTES, (-1,))
INPUTS = {spec.name: spec for spec in (POINTS, COUNTS, SENSOR_HEIGHT, OWN_HEADING, CONTACT_ID)}
MANY_DIMENSIONS = 8  # too many to repeat to the caller
OPTIONAL_INPUTS = [name for name in INPUTS if name != POINTS.name]

TEXT = (
    "All contacts' points one after the other in points (metres, level frame: x ahead of the sensor's own vessel, "
    "y to port, z up); counts says how many are each contact's, absent: all are one contact's. The other inputs "
    "and all outputs have one element or row a contact; NaN and empty stand for not given and not known."
)


def find_input(name: str, taken: Container[str]) -> TensorSpec:
    """The spec of an input.

    Raises:
        InvalidInput: No such input, or one of `taken`.
    """
    if name in taken:
        raise InvalidInput(f"expected each input once, got {name} again")
    if name not in INPUTS:
        raise InvalidInput(f"expected only inputs {', '.join(INPUTS)}, got {name!r:.80}")
    return INPUTS[name]


def check_header(spec: TensorSpec, datatype: str, shape: Sequence[int], limits: Limits) -> tuple[int, ...]:
    """The shape that a caller gives an input, before any of its elements is looked at.

    Raises:
        InvalidInput: Another data type or shape than the spec's.
        TooLarge: More contacts than the limit.
    """
    if datatype != spec.datatype:
        raise InvalidInput(f"expected input {spec.name} of datatype {spec.datatype}, got {datatype!r:.40}")
    fits = len(shape) == len(spec.shape) and all(
        size >= 0 and wanted in (-1, size) for size, wanted in zip(shape, spec.shape, strict=True)
    )
    if not fits:
        given = f"{list(shape)!s:.80}" if len(shape) < MANY_DIMENSIONS else f"one of {len(shape)} dimensions"
        raise InvalidInput(f"expected input {spec.name} of shape {list(spec.shape)}, got {given}")
    if spec not in (POINTS, COUNTS):  # those are counted first, so that the metrics know how many were refused
        check_contacts(shape[0], limits)
    return tuple(shape)


def count_contacts(inputs: Mapping[str, Tensor]) -> int:
    """How many contacts the inputs are of."""
    return len(inputs[COUNTS.name].values) if COUNTS.name in inputs else 1


def to_contacts(inputs: Mapping[str, Tensor], limits: Limits) -> tuple[list[str], list[Contact | InvalidInput]]:
    """The contacts of the inputs with their ids, an error in the place of each that cannot be one.

    Raises:
        InvalidInput: No points, or inputs that do not belong together.
        TooLarge: More contacts than the limit.
    """
    if POINTS.name not in inputs:
        raise InvalidInput(f"expected input {POINTS.name}, got none")
    points = np.asarray(inputs[POINTS.name].values).reshape(-1, 3)
    ends = np.cumsum(_counts(inputs, len(points), limits))
    clusters = np.split(points, ends[:-1])
    ids = _ids(inputs, len(clusters))
    heights = _numbers(inputs, SENSOR_HEIGHT, len(clusters))
    headings = _numbers(inputs, OWN_HEADING, len(clusters))
    rows = zip(clusters, ids, heights, headings, strict=True)
    return ids, [_contact(*row, limits) for row in rows]


def _counts(inputs: Mapping[str, Tensor], points: int, limits: Limits) -> Int[np.ndarray, " contacts"]:
    if COUNTS.name not in inputs:
        return np.array([points])
    counts = np.asarray(inputs[COUNTS.name].values, np.int64)
    check_contacts(len(counts), limits)
    if counts.min() < 0:
        raise InvalidInput(f"expected {COUNTS.name} of 0 or more, got {counts.min()}")
    if counts.sum() != points:
        raise InvalidInput(f"expected {COUNTS.name} that add up to {points} points, got a sum of {counts.sum()}")
    return counts


def _numbers(inputs: Mapping[str, Tensor], spec: TensorSpec, contacts: int) -> list[float | None]:
    if spec.name not in inputs:
        return [None] * contacts
    values = np.asarray(_each(inputs[spec.name], contacts))
    return [None if np.isnan(value) else float(value) for value in values]


def _ids(inputs: Mapping[str, Tensor], contacts: int) -> list[str]:
    if CONTACT_ID.name not in inputs:
        return [""] * contacts
    try:
        return [bytes(item).decode() for item in _each(inputs[CONTACT_ID.name], contacts)]
    except UnicodeDecodeError as error:
        raise InvalidInput(f"expected UTF-8 in input {CONTACT_ID.name}, got bytes that are not") from error


def _each(tensor: Tensor, contacts: int) -> Any:
    if len(tensor.values) != contacts:
        raise InvalidInput(
            f"expected {contacts} elements of input {tensor.spec.name}, one a contact, got {len(tensor.values)}"
        )
    return tensor.values


def _contact(
    points: Float32[np.ndarray, "n 3"], contact_id: str, height: float | None, own: float | None, limits: Limits
) -> Contact | InvalidInput:
    try:
        return make_contact(
            points_from_bytes(points.tobytes(), limits),
            contact_id=contact_id,
            sensor_height_m=height,
            own_true_heading_deg=own,
        )
    except InvalidInput as error:
        return error
