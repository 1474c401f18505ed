"""The aligned look: what a network says is applied in the frame that it was shown."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import ANGLES, BOAT, constant, heading_error_deg, place, properties, random_points
from shipshape.alignment import correct, look, look_inputs
from shipshape.types import Pose, ReferenceBox

GUESS = Pose(0.4, (40.0, -10.0, -3.0), BOAT)
NO_SHIFT = np.zeros(3, np.float32)
SAME_SIZE = np.log(np.float32([1.0, BOAT.beam / BOAT.length, BOAT.height / BOAT.length]))


@properties(100)
@given(ANGLES, ANGLES, st.tuples(*[st.floats(-5.0, 5.0)] * 3), st.floats(5.0, 40.0))
def test_the_true_correction_leads_to_the_true_pose(
    heading: float, turn: float, step: tuple[float, float, float], length: float
) -> None:
    guess = Pose(heading, (40.0, -10.0, -3.0), ReferenceBox(length, length / 3, 4.0))
    ahead = cmath.rect(1.0, heading)  # the guess's own x axis; its y axis is a quarter turn on
    moved = complex(40.0, -10.0) + step[0] * ahead + step[1] * ahead * 1j

    pose = correct(
        guess,
        turn=turn,
        shift=(np.array(step) / length).astype(np.float32),
        size=np.log(np.array([14.0, 5.0, 6.0]) / length).astype(np.float32),
    )

    assert heading_error_deg(pose.heading, heading + turn) < 1e-4
    np.testing.assert_allclose(pose.origin_level, (moved.real, moved.imag, -3.0 + step[2]), atol=1e-4)
    np.testing.assert_allclose((pose.size.length, pose.size.beam, pose.size.height), (14.0, 5.0, 6.0), rtol=1e-4)


def test_no_correction_changes_nothing() -> None:
    pose = correct(GUESS, turn=0.0, shift=NO_SHIFT, size=SAME_SIZE)

    assert pose.heading == pytest.approx(GUESS.heading)
    assert pose.origin_level == pytest.approx(GUESS.origin_level)
    assert pose.size.beam == pytest.approx(BOAT.beam, rel=1e-5)


def test_a_look_hands_on_what_the_network_said() -> None:
    network = constant([[0.1, -2.0]], [[1.5]], [[0.25, 0.0, 0.0]], SAME_SIZE[None], [[3.0, 1.0, 2.0]])

    found = look(random_points(20, seed=1) + np.float32([40, -10, 0]), GUESS, network)

    assert found.pose.heading == pytest.approx(0.5)
    assert math.dist(found.pose.origin_level, GUESS.origin_level) == pytest.approx(3.0, abs=1e-5)
    assert found.heading_std == pytest.approx(math.exp(-2.0))
    assert found.flip_logit == 1.5
    np.testing.assert_array_equal(found.class_logits, [3.0, 1.0, 2.0])


@properties(20)
@given(ANGLES, ANGLES)
def test_a_look_sees_the_vessel_and_not_where_the_sensor_stands(heading: float, bearing: float) -> None:
    pixel = 1.2 * BOAT.length / 64
    hull = random_points(40, seed=2, spread=1.5)
    hull[:, :2] = (np.floor(hull[:, :2] / pixel) + 0.5) * pixel  # in the middle of cells: rounding moves none
    hull[:, 2] = np.abs(hull[:, 2])
    pose = Pose(heading, (50 * math.cos(bearing), 50 * math.sin(bearing), -3.0), BOAT)

    planes, features = look_inputs(place(hull, pose), pose)

    straight, known = look_inputs(hull, Pose(0.0, (0.0, 0.0, 0.0), BOAT))
    assert planes.shape == (9, 32, 64)
    np.testing.assert_allclose(planes, straight, atol=1e-4)
    np.testing.assert_allclose(features, [math.log(12.0), math.log(50.0), math.log(40)], atol=1e-5)
    np.testing.assert_allclose(known, [math.log(12.0), 0.0, math.log(40)], atol=1e-6)
