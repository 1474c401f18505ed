import numpy as np
import pytest

from shipshape_lab.simulator.sensor import HDL64E, LIDARS, OS1_64, PANDAR64


@pytest.mark.parametrize("lidar", LIDARS, ids=lambda lidar: lidar.name)
def test_every_preset_has_64_channels_from_top_to_bottom(lidar):
    assert lidar.elevations_deg.shape == (64,)
    assert np.all(np.diff(lidar.elevations_deg) < 0)


@pytest.mark.parametrize(("lidar", "view_deg"), [(PANDAR64, 40.0), (OS1_64, 45.0), (HDL64E, 26.33)])
def test_vertical_field_of_view_is_the_data_sheets(lidar, view_deg):
    assert np.ptp(lidar.elevations_deg) == pytest.approx(view_deg, abs=0.01)


def test_pandar64_is_dense_near_the_horizon():
    near = PANDAR64.elevations_deg[(PANDAR64.elevations_deg >= -6.01) & (PANDAR64.elevations_deg <= 2.01)]
    assert np.diff(near) == pytest.approx(-1 / 6)


def test_directions_are_unit_vectors_inside_the_window_on_the_azimuth_grid():
    directions = OS1_64.directions(azimuth=(3.0, 3.5), elevation=(-0.1, 0.05), phase=0.25)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0)
    turned = np.unwrap(np.arctan2(directions[:, 1], directions[:, 0]))
    lifted = np.arcsin(directions[:, 2])
    assert turned.min() >= 3.0
    assert turned.max() <= 3.5
    assert lifted.min() >= -0.1
    assert lifted.max() <= 0.05
    shares = np.degrees(turned) / OS1_64.azimuth_step_deg - 0.25
    assert shares == pytest.approx(np.round(shares), abs=1e-6)


def test_half_of_the_pulses_return_head_on_from_the_half_range():
    assert PANDAR64.return_probability(np.array([200.0]), np.array([1.0])) == pytest.approx(0.5)


def test_returns_fade_with_range_and_incidence_and_end_at_the_longest_range():
    ranges = np.array([10.0, 100.0, 229.0, 231.0, np.inf])
    head_on = PANDAR64.return_probability(ranges, np.ones(5))
    grazing = PANDAR64.return_probability(ranges, np.full(5, 0.1))
    assert np.all(np.diff(head_on[:4]) < 0)
    assert np.all(grazing[:3] < head_on[:3])
    assert head_on[3:].tolist() == [0.0, 0.0]
    assert PANDAR64.return_probability(ranges, np.zeros(5)).tolist() == [0.0] * 5
