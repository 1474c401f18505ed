"""The sight frame: a cluster looks the same in it from whatever bearing it was seen."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import ANGLES, BOAT, contact_of, properties, seen_hull, turn_level
from shipshape.sight import sight_frame, to_sight
from shipshape.types import Pose

SENSOR = np.zeros((1, 3), np.float32)


def cluster(heading: float = 0.6, distance: float = 60.0) -> np.ndarray:
    return seen_hull(Pose(heading, (distance, 0.0, -4.0), BOAT))


@properties()
@given(ANGLES, ANGLES, st.floats(15.0, 200.0))
def test_a_cluster_looks_the_same_from_every_bearing(heading: float, bearing: float, distance: float) -> None:
    ahead = contact_of(cluster(heading, distance))
    aside = contact_of(turn_level(ahead.points_level, bearing))

    frame, turned = sight_frame(ahead), sight_frame(aside)

    np.testing.assert_allclose(
        to_sight(aside.points_level, turned), to_sight(ahead.points_level, frame), atol=2e-3
    )
    assert math.remainder(turned.bearing - frame.bearing - bearing, math.tau) == pytest.approx(0.0, abs=1e-5)
    assert turned.range_m == pytest.approx(frame.range_m, abs=1e-3)


@properties()
@given(ANGLES, ANGLES)
def test_the_cluster_is_centred_and_stands_on_its_lowest_point(heading: float, bearing: float) -> None:
    contact = contact_of(turn_level(cluster(heading), bearing))

    points = to_sight(contact.points_level, sight_frame(contact))

    np.testing.assert_allclose((points.min(axis=0) + points.max(axis=0))[:2] / 2, 0.0, atol=1e-3)
    assert points[:, 2].min() == pytest.approx(0.0, abs=1e-5)


@properties()
@given(ANGLES, ANGLES)
def test_the_sensor_lies_toward_minus_x(heading: float, bearing: float) -> None:
    contact = contact_of(turn_level(cluster(heading), bearing))
    frame = sight_frame(contact)

    sensor = to_sight(SENSOR, frame)[0]

    assert sensor[0] < -0.95 * frame.range_m


def test_what_lies_to_the_left_of_the_line_of_sight_has_positive_y() -> None:
    contact = contact_of(cluster(math.pi / 2))  # abeam, bow to the left as the sensor sees it

    points = to_sight(contact.points_level, sight_frame(contact))

    leftmost = contact.points_level[:, 1].argmax()
    assert points[leftmost, 1] == pytest.approx(BOAT.length / 2, abs=1e-3)


def test_a_known_sensor_height_gives_the_water() -> None:
    points = cluster() + np.float32([0.0, 0.0, 1.5])  # the lowest returns lie 1.5 m up the hull

    blind, knowing = sight_frame(contact_of(points)), sight_frame(contact_of(points, sensor_height=4.0))

    assert (blind.knows_water, knowing.knows_water) == (False, True)
    assert blind.origin_level[2] == pytest.approx(-2.5)
    assert knowing.origin_level[2] == -4.0
    assert to_sight(points, knowing)[:, 2].min() == pytest.approx(1.5, abs=1e-5)


def test_range_is_horizontal() -> None:
    contact = contact_of(cluster(math.pi / 2, distance=60.0), sensor_height=40.0)

    assert sight_frame(contact).range_m == pytest.approx(60.0 - BOAT.beam / 2, abs=1e-3)
