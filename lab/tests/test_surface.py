import numpy as np
import pytest
import trimesh
from hulls import box_hull

from shipshape_lab.simulator.surface import sample_surface
from shipshape_lab.simulator.vessel import Vessel


def sample(vessel, count=3000):
    return sample_surface(vessel, count, np.random.default_rng(0))


def test_shape_type_and_determinism():
    points = sample(box_hull(), 500)
    assert points.shape == (500, 3)
    assert points.dtype == np.float32
    assert np.array_equal(points, sample(box_hull(), 500))


def test_a_box_inside_a_box_stays_unseen():
    inner = box_hull(10.0, 3.0, 2.0).mesh.apply_translation([0, 0, 1.0])
    points = sample(Vessel("nested", trimesh.util.concatenate([box_hull().mesh, inner])))
    outside = np.abs(points - [0, 0, 2.0]) - [10.0, 3.0, 2.0]
    assert np.abs(outside.max(axis=1)).max() < 1e-4


def test_the_bottom_is_left_out_and_the_rest_is_even():
    points = sample(box_hull(), 6000)
    assert np.mean(points[:, 2] < 1e-3) < 0.01
    deck = np.mean(points[:, 2] > 4.0 - 1e-3)
    assert deck == pytest.approx(120 / (120 + 4 * 52), abs=0.03)


def test_what_lies_under_water_is_left_out():
    sunk = box_hull(height=8.0).mesh.apply_translation([0, 0, -4.0])
    assert sample(Vessel("sunk", sunk)).min(axis=0)[2] >= 0.0


def test_a_hull_that_shows_nothing_is_refused():
    sunk = box_hull().mesh.apply_translation([0, 0, -9.0])
    with pytest.raises(ValueError, match="outer surface"):
        sample(Vessel("sunk", sunk), 10)
