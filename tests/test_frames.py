"""Angles and rotations; SciPy's rotations are the referee."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from builders import ANGLES, properties, random_points
from shipshape import frames
from shipshape.types import Pose, ReferenceBox

MANY_TURNS = st.floats(-1e3, 1e3, allow_nan=False)
COORDINATES = st.floats(-200.0, 200.0, allow_nan=False)
ORIGINS = st.tuples(COORDINATES, COORDINATES, st.floats(-20.0, 5.0))


@properties(200)
@given(MANY_TURNS)
def test_wrap_angle_stays_in_its_range_and_is_the_same_direction(angle: float) -> None:
    wrapped = frames.wrap_angle(angle)

    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@properties(200)
@given(MANY_TURNS)
def test_wrap_half_turn_stays_in_its_range_and_is_the_same_axis(angle: float) -> None:
    wrapped = frames.wrap_half_turn(angle)

    assert -math.pi / 2 < wrapped <= math.pi / 2
    assert math.sin(wrapped - angle) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(math.pi, math.pi), (-math.pi, math.pi), (0.0, 0.0), (5 * math.pi, math.pi)]
)
def test_the_ends_of_a_turn_are_one_angle(angle: float, wrapped: float) -> None:
    assert frames.wrap_angle(angle) == pytest.approx(wrapped)


@pytest.mark.parametrize("angle", [math.pi / 2, -math.pi / 2])
def test_the_ends_of_a_half_turn_are_one_axis(angle: float) -> None:
    assert frames.wrap_half_turn(angle) == math.pi / 2


@properties()
@given(ANGLES, ORIGINS)
def test_to_level_agrees_with_scipy(heading: float, origin: tuple[float, float, float]) -> None:
    points = random_points(20, seed=1, spread=30.0)

    level = frames.to_level(points, heading, origin)

    expected = Rotation.from_euler("z", heading).apply(points) + origin
    assert level.dtype == np.float32
    np.testing.assert_allclose(level, expected, atol=1e-4)


@properties()
@given(ANGLES, ORIGINS)
def test_to_vessel_is_the_inverse_of_to_level(heading: float, origin: tuple[float, float, float]) -> None:
    points = random_points(20, seed=2, spread=30.0)

    back = frames.to_vessel(frames.to_level(points, heading, origin), heading, origin)

    np.testing.assert_allclose(back, points, atol=1e-4)


@properties()
@given(ANGLES, ORIGINS)
def test_a_change_of_frame_keeps_distances_and_handedness(
    heading: float, origin: tuple[float, float, float]
) -> None:
    points = random_points(10, seed=3, spread=30.0)

    moved = frames.to_vessel(points, heading, origin)

    np.testing.assert_allclose(pdist(moved), pdist(points), atol=1e-3)
    assert np.linalg.det(frames.R_level_vessel(heading)) == pytest.approx(1.0)


def test_transforms_leave_their_input_alone() -> None:
    points = random_points(10, seed=4)
    before = points.copy()

    frames.to_level(points, 0.7, (1.0, 2.0, 3.0))
    frames.to_vessel(points, 0.7, (1.0, 2.0, 3.0))

    np.testing.assert_array_equal(points, before)


def test_what_lies_before_the_bow_has_positive_x_and_what_lies_to_port_positive_y() -> None:
    # A vessel 50 m ahead with its bow to port (heading +90 degrees): its bow is further to port of the sensor.
    points = np.array([[50.0, 6.0, 1.0], [48.0, 0.0, 1.0]], np.float32)

    bow, port = frames.to_vessel(points, math.pi / 2, (50.0, 0.0, 0.0))

    np.testing.assert_allclose(bow, [6.0, 0.0, 1.0], atol=1e-5)
    np.testing.assert_allclose(port, [0.0, 2.0, 1.0], atol=1e-5)


@properties()
@given(ANGLES, st.floats(10.0, 200.0), ANGLES)
def test_aspect_is_the_turn_from_the_bow_to_the_sensor(bearing: float, distance: float, turn: float) -> None:
    origin = (distance * math.cos(bearing), distance * math.sin(bearing), -3.0)
    bow_on = bearing + math.pi  # the bow points back along the line of sight

    aspect = frames.aspect_deg(bow_on + turn, origin)

    assert aspect == pytest.approx(abs(math.degrees(turn)), abs=1e-6)


@pytest.mark.parametrize(
    ("heading_deg", "aspect"), [(180.0, 0.0), (90.0, 90.0), (-90.0, 90.0), (0.0, 180.0), (135.0, 45.0)]
)
def test_aspects_that_a_sailor_knows(heading_deg: float, aspect: float) -> None:
    # The vessel lies dead ahead of the sensor.
    assert frames.aspect_deg(math.radians(heading_deg), (60.0, 0.0, -3.0)) == pytest.approx(aspect)


@pytest.mark.parametrize(
    ("heading_deg", "own", "true"),
    [(0.0, 0.0, 0.0), (0.0, 90.0, 90.0), (90.0, 0.0, 270.0), (-90.0, 0.0, 90.0), (180.0, 350.0, 170.0)],
)
def test_true_heading_turns_clockwise_from_north(heading_deg: float, own: float, true: float) -> None:
    assert frames.true_heading_deg(math.radians(heading_deg), own) == pytest.approx(true)


@properties(100)
@given(ANGLES, st.floats(-720.0, 720.0))
def test_true_heading_stays_in_its_range(heading: float, own: float) -> None:
    assert 0.0 <= frames.true_heading_deg(heading, own) < 360.0


@properties()
@given(ANGLES, ANGLES)
def test_a_pose_turns_in_place(heading: float, turn: float) -> None:
    pose = Pose(heading, (30.0, -4.0, -2.0), ReferenceBox(12.0, 4.0, 3.0))

    turned = pose.turned(turn)

    assert turned.heading == pytest.approx(frames.wrap_angle(heading + turn))
    assert (turned.origin_level, turned.size) == (pose.origin_level, pose.size)


def test_a_pose_carries_points_there_and_back() -> None:
    pose = Pose(0.9, (30.0, -4.0, -2.0), ReferenceBox(12.0, 4.0, 3.0))
    points = random_points(10, seed=5)

    np.testing.assert_allclose(pose.to_vessel(pose.to_level(points)), points, atol=1e-5)
    np.testing.assert_allclose(pose.to_vessel(np.array([pose.origin_level], np.float32)), 0.0, atol=1e-6)
