"""An order on its way to a worker process: plain values; wishes, which callers repeat, are pickled only once."""

import pickle
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from shipshape.serving.encoding import Wishes
from shipshape.serving.model import Encode, Order
from shipshape.types import Contact

REMEMBERED = 256  # wishes, on either end

Wire = tuple[bytes, str, float | None, float | None, bytes]


def to_wire(order: Order[Any]) -> Wire:
    """What `from_wire` makes the same order of."""
    contact = order.contact
    return (
        contact.points_level.tobytes(),
        contact.contact_id,
        contact.sensor_height,
        contact.own_true_heading_deg,
        _packed(_timeless(order.wishes), order.encode),
    )


def from_wire(wire: Wire) -> Order[Any]:
    """The order."""
    points, contact_id, sensor_height, own_true_heading_deg, how = wire
    points_level = np.frombuffer(points, np.float32).reshape(-1, 3)
    contact = Contact(points_level, contact_id, sensor_height, own_true_heading_deg)
    return Order(contact, *_unpacked(how))


def _timeless(wishes: Wishes) -> Wishes:
    """Without what differs from request to request and is no worker's matter."""
    if wishes.captured_at is None:
        return wishes
    return replace(wishes, captured_at=None, max_age_s=None)


@lru_cache(REMEMBERED)
def _packed(wishes: Wishes, encode: Encode[Any]) -> bytes:
    return pickle.dumps((wishes, encode), pickle.HIGHEST_PROTOCOL)


@lru_cache(REMEMBERED)
def _unpacked(how: bytes) -> tuple[Wishes, Encode[Any]]:
    wishes, encode = pickle.loads(how)
    return wishes, encode
