"""Packed points of many contacts, one after the other, and how many points each has -> points a contact."""

import numpy as np
from jaxtyping import Float32

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import POINT_BYTES, Limits, points_from_bytes


def parse_counts(text: str) -> list[int]:
    """Numbers of points separated by commas, one a contact.

    Raises:
        InvalidInput: Another form.
    """
    parts = text.split(",")
    for part in parts:
        if not (part.isascii() and part.isdigit() and len(part) <= 10):
            raise InvalidInput(f"expected counts as whole numbers separated by commas, got {part!r:.80}")
    return [int(part) for part in parts]


def contacts_from_bytes(
    packed: bytes, counts: list[int], limits: Limits
) -> list[Float32[np.ndarray, "n 3"] | InvalidInput]:
    """The points of each contact, level frame, metres; an error in the place of each that has too many.

    Raises:
        InvalidInput: Not as many bytes as the counts say.
    """
    expected = POINT_BYTES * sum(counts)
    if len(packed) != expected:
        raise InvalidInput(f"expected {expected} bytes for {sum(counts)} points, got {len(packed)}")
    contacts: list[Float32[np.ndarray, "n 3"] | InvalidInput] = []
    start = 0
    for count in counts:
        end = start + POINT_BYTES * count
        try:
            contacts.append(points_from_bytes(packed[start:end], limits))
        except InvalidInput as error:
            contacts.append(error)
        start = end
    return contacts
