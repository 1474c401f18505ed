import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from shipshape.errors import InvalidInput, TooLarge
from shipshape.quantised import MOST_STEPS, POINT_BYTES, dequantise, quantise
from shipshape.serving.encoding import Limits
from shipshape.serving.encoding_int16 import points_from_int16
from shipshape.serving.grpc.convert import to_contact
from shipshape.v1 import shipshape_pb2 as pb

LIMITS, ORIGIN = Limits(), (0.0, 0.0, 0.0)
COORDINATES = st.floats(-1000, 1000, width=32)
POINTS = arrays(np.float32, st.tuples(st.integers(0, 60), st.just(3)), elements=COORDINATES)
PACKED = np.arange(-6, 6, dtype="<i2").tobytes()


@given(POINTS)
def test_no_point_moves_by_more_than_half_a_step(points):
    quantised = quantise(points)
    assert len(quantised.steps) == POINT_BYTES * len(points) == points.nbytes // 2
    allowed = 0.5001 * quantised.scale + np.spacing(np.float32(1000))
    assert np.abs(dequantise(quantised).astype(np.float64) - points).max(initial=0) <= allowed


@given(POINTS, st.sampled_from([0.05, 0.1]))
def test_a_scale_of_ones_own_is_kept(points, scale):
    quantised = quantise(points, scale)
    assert quantised.scale == scale
    allowed = 0.5001 * scale + np.spacing(np.float32(1000))
    assert np.abs(dequantise(quantised).astype(np.float64) - points).max(initial=0) <= allowed


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
def test_a_scale_that_is_none_is_refused(scale):
    with pytest.raises(InvalidInput, match=r"^expected a scale of int16 points above 0, got"):
        quantise(np.zeros((2, 3), np.float32), scale)


def test_a_scale_that_cannot_hold_the_points_is_made_coarser():
    points = np.array([[0, 0, 0], [100, 0, 0]], np.float32)
    assert quantise(points, 1e-4).scale == quantise(points).scale == 50 / MOST_STEPS


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_points_that_are_none_are_refused(value):
    with pytest.raises(InvalidInput, match=r"^expected finite points"):
        quantise(np.full((2, 3), value, np.float32))


def test_the_ends_of_the_scale():
    """By hand: 3 m from the middle at 1/32767 of it a step."""
    points = np.array([[-3, 0, 0], [3, 1, -1]], np.float32)
    quantised = quantise(points)
    assert quantised.origin_level == (0, 0.5, -0.5)
    assert np.frombuffer(quantised.steps, "<i2").reshape(-1, 3)[:, 0].tolist() == [-MOST_STEPS, MOST_STEPS]


def test_a_message_of_int16_points_is_a_contact():
    origin = pb.Point(x=10, y=-2, z=0.5)
    message = pb.Contact(contact_id="c", points_int16=PACKED, origin=origin, scale=0.5, sensor_height_m=3)
    contact = to_contact(pb.Contact.FromString(message.SerializeToString()), LIMITS)
    steps = np.arange(-6, 6).reshape(-1, 3)
    assert np.array_equal(contact.points_level, (steps * 0.5 + [10, -2, 0.5]).astype(np.float32))
    assert (contact.contact_id, contact.sensor_height) == ("c", 3)


@pytest.mark.parametrize(
    "fields",
    [
        {"points_int16": PACKED, "scale": 0.0},
        {"points_int16": PACKED, "scale": math.nan},
        {"points_int16": PACKED, "scale": 1.0, "origin": pb.Point(y=math.inf)},
        {"points_int16": PACKED[:-1], "scale": 1.0},
        {"points_int16": PACKED, "scale": 1.0, "points": bytes(12)},
    ],
)
def test_messages_that_are_refused(fields):
    with pytest.raises(InvalidInput, match=r"^expected .+, got .+"):
        to_contact(pb.Contact(**fields), LIMITS)


def test_too_many_points_are_refused_before_they_are_decoded():
    with pytest.raises(TooLarge):
        points_from_int16(bytes(6 * 65537), ORIGIN, 1.0, LIMITS)


def test_what_float32_cannot_hold_is_infinite_and_the_pipelines_to_refuse():
    assert not np.isfinite(points_from_int16(PACKED, ORIGIN, 1e300, LIMITS)).all()


@given(st.binary(max_size=60), st.floats(), st.floats())
def test_no_bytes_are_more_than_a_refusal(packed, origin, scale):
    try:
        points = points_from_int16(packed, (origin, 0.0, 0.0), scale, LIMITS)
    except InvalidInput:
        return
    assert points.shape == (len(packed) // 6, 3)
