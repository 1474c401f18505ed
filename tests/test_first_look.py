"""The first look: what the network is shown of a cluster, and what becomes of its answer."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from builders import ANGLES, BOAT, axis_error_deg, constant, properties, random_points
from shipshape.first_look import CENTRES, MOST_POINTS, NEIGHBOURS, RADII, UNIT, first_look, network_inputs
from shipshape.sight import SightFrame
from shipshape.types import Pose

SIGHT = SightFrame(0.0, (30.0, 40.0, -3.0), True)
COUNTS = st.integers(1, 600)


@properties(30)
@given(COUNTS, st.integers(0, 1000))
def test_groups_are_as_many_as_there_are_points_for(count: int, seed: int) -> None:
    shown = network_inputs(random_points(count, seed, spread=8.0), SIGHT)

    groups, wholes = min(count, CENTRES[0]), min(count, CENTRES[1])
    assert shown["near"].shape == (6, groups, NEIGHBOURS)
    assert shown["far"].shape == (3, wholes, NEIGHBOURS)
    assert shown["centres"].shape == (3, wholes, 1)
    assert shown["members"].shape == (wholes * NEIGHBOURS,)
    assert shown["members"].min() >= 0
    assert shown["members"].max() < groups
    np.testing.assert_allclose(shown["features"], [math.log(50.0), math.log(count), 1.0], rtol=1e-6)


@properties(30)
@given(COUNTS, st.integers(0, 1000))
def test_members_lie_around_their_centres_and_are_points(count: int, seed: int) -> None:
    points = random_points(count, seed, spread=8.0)

    shown = network_inputs(points, SIGHT)

    offsets, places = shown["near"][:3], UNIT * shown["near"][3:]
    assert np.linalg.norm(offsets, axis=0).max() <= 1.0 + 1e-5
    assert np.linalg.norm(shown["far"], axis=0).max() <= 1.0 + 1e-5
    assert cKDTree(points).query(places.reshape(3, -1).T)[0].max() < 1e-4
    # A group's members less their offsets all give the one centre of the group.
    centres = places - RADII[0] * offsets
    np.testing.assert_allclose(centres, np.broadcast_to(centres[:, :, :1], centres.shape), atol=1e-4)
    # And so do the groups of a group of groups.
    members = centres[:, shown["members"], 0].reshape(shown["far"].shape)
    wholes = members - RADII[1] * shown["far"]
    np.testing.assert_allclose(wholes, np.broadcast_to(UNIT * shown["centres"], wholes.shape), atol=1e-4)


def test_a_large_cluster_is_shown_evenly() -> None:
    along = np.linspace(-100.0, 100.0, 3 * MOST_POINTS, dtype=np.float32)

    shown = network_inputs(np.column_stack([along, 0 * along, 0 * along]), SIGHT)

    centres = np.sort((shown["near"][3] * UNIT - shown["near"][0] * RADII[0])[:, 0])
    assert np.diff(centres).max() < 200.0 / CENTRES[0] * 2.5
    assert (centres[0], centres[-1]) == (pytest.approx(-100.0, abs=1.0), pytest.approx(100.0, abs=1.0))


@properties(50)
@given(ANGLES, ANGLES, ANGLES)
def test_the_answer_is_told_along_the_line_of_sight(bearing: float, axis: float, ahead: float) -> None:
    network = constant(
        [[math.sin(2 * axis), math.cos(2 * axis)]],
        [[0.5, -0.25]],
        [np.log([12.0, 4.0, 3.0])],
        [[2.0 * math.cos(ahead), 2.0 * math.sin(ahead)]],
        [[3.0, 1.0]],
    )

    found = first_look(random_points(20, seed=1), SightFrame(bearing, (30.0, 20.0, -3.0), False), network)

    right = np.exp(1j * bearing)
    moved = complex(30.0, 20.0) + UNIT * (0.5 * right - 0.25 * right * 1j)
    assert axis_error_deg(found.pose.heading, bearing + axis) < 1e-3
    np.testing.assert_allclose(found.pose.origin_level, (moved.real, moved.imag, -3.0), atol=1e-4)
    size = found.pose.size
    np.testing.assert_allclose((size.length, size.beam, size.height), (12, 4, 3), rtol=1e-5)
    np.testing.assert_array_equal(found.class_logits, [3.0, 1.0])
    for turn in (0.0, 0.4, math.pi):
        flip = found.flip_logit(Pose(bearing + ahead + turn, (0.0, 0.0, 0.0), BOAT))
        assert flip == pytest.approx(-4.0 * math.cos(turn), abs=1e-4)
