"""Heading peers against shapes whose axis is known."""

import numpy as np
import pytest

from shipshape_lab import heading_peers
from shipshape_lab.metrics import heading_error_deg


def faces(length, beam, heading, noise=0.0):
    """Two visible faces of a rectangle, 0.1 m between points, at 60 m; a face of length 0 is not seen."""
    along = np.stack([np.arange(0.0, length, 0.1), np.zeros(len(np.arange(0.0, length, 0.1)))], axis=1)
    across = np.stack([np.zeros(len(np.arange(0.0, beam, 0.1))), np.arange(0.0, beam, 0.1)], axis=1)
    flat = np.concatenate([along, across]) + np.random.default_rng(1).normal(
        0.0, noise, (len(along) + len(across), 2)
    )
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    return np.column_stack([flat @ turn.T + [60.0, 5.0], np.ones(len(flat))]).astype(np.float32)


@pytest.mark.parametrize("heading", [-1.4, -0.3, 0.0, 0.5, 1.2])
def test_the_l_shape_of_two_faces_gives_the_longer_face(heading):
    found = heading_peers.by_l_shape(faces(20.0, 6.0, heading, noise=0.02))
    assert heading_error_deg(found, heading) <= heading_peers.STEP_DEG


@pytest.mark.parametrize("heading", [-1.4, 0.0, 0.5])
@pytest.mark.parametrize("method", [heading_peers.by_min_area, heading_peers.by_principal_axis])
def test_one_face_gives_its_own_direction(method, heading):
    assert heading_error_deg(method(faces(20.0, 0.1, heading)), heading) < 0.1


def test_the_least_rectangle_of_a_whole_outline_is_the_outline():
    near = faces(20.0, 6.0, 0.3)
    cos, sin = np.cos(0.3), np.sin(0.3)
    centre = [60.0 + 10.0 * cos - 3.0 * sin, 5.0 + 10.0 * sin + 3.0 * cos, 1.0]
    whole = np.concatenate([near, 2 * np.array(centre) - near]).astype(np.float32)
    assert heading_error_deg(heading_peers.by_min_area(whole), 0.3) < 0.5


def test_the_principal_axis_of_an_l_leans_by_the_analytic_angle():
    # Legs a and b of even density: var_x - var_y and cov_xy of the two lines, worked out by hand.
    a, b = 20.0, 6.0
    total = a + b
    var_x = a**3 / 3 / total - (a**2 / 2 / total) ** 2
    var_y = b**3 / 3 / total - (b**2 / 2 / total) ** 2
    cov = -(a**2 / 2 / total) * (b**2 / 2 / total)
    lean = 0.5 * np.arctan2(2 * cov, var_x - var_y)
    assert np.degrees(abs(lean)) > 3.0
    assert heading_error_deg(heading_peers.by_principal_axis(faces(a, b, 0.7)), 0.7 + lean) < 0.2


@pytest.mark.parametrize(
    "method", [heading_peers.by_min_area, heading_peers.by_principal_axis, heading_peers.by_l_shape]
)
def test_an_end_on_view_is_taken_for_the_length(method):
    assert heading_error_deg(method(faces(1.0, 6.0, 0.4)), 0.4) > 75.0


def test_a_single_far_point_does_not_turn_the_l_shape():
    points = faces(20.0, 6.0, 0.5)
    stray = np.array([[70.0, 12.0, 1.0]], np.float32)
    assert heading_error_deg(heading_peers.by_l_shape(np.concatenate([points, stray])), 0.5) < 2.0
