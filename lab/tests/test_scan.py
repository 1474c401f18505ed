import numpy as np
import pytest
from hulls import box_hull, perfect_lidar, to_vessel
from hypothesis import given, settings
from hypothesis import strategies as st

from shipshape_lab.simulator.occluders import BoxOccluder, HullOccluder
from shipshape_lab.simulator.scan import Conditions, scan_vessel
from shipshape_lab.simulator.sea import Motion, Placement, SeaState
from shipshape_lab.simulator.sensor import PANDAR64
from shipshape_lab.simulator.skirt import with_skirt
from shipshape_lab.simulator.vessel import Vessel

BOX = box_hull()
HALF = np.array([10.0, 3.0])


def scan(placement, *, conditions=None, lidar=None, seed=0, vessel=BOX):
    return scan_vessel(
        vessel,
        lidar or perfect_lidar(),
        placement=placement,
        conditions=conditions or Conditions(),
        rng=np.random.default_rng(seed),
    )


@pytest.mark.parametrize("range_m", [15.0, 30.0, 110.0, 200.0])
@pytest.mark.parametrize("heading_deg", [0.0, 37.0, 90.0, -145.0, 180.0])
def test_points_of_a_box_lie_on_its_near_faces_only(range_m, heading_deg):
    placement = Placement(range_m, np.radians(heading_deg), bearing=0.7)
    seen = scan(placement)
    points = to_vessel(seen.T_level_vessel, seen.points_level.astype(float))
    sensor = to_vessel(seen.T_level_vessel, np.zeros(3))
    near = np.column_stack([np.abs(points[:, axis] - np.sign(sensor[axis]) * HALF[axis]) for axis in (0, 1)])
    near[:, np.abs(sensor[:2]) <= HALF] = np.inf
    assert len(points) > 20
    assert near.min(axis=1).max() < 1e-4


def test_the_wall_abeam_gets_as_many_points_as_rays_fit_on_it():
    seen = scan(Placement(50.0, np.pi / 2))
    columns = 2 * np.degrees(np.arctan2(10.0, 47.0)) / 0.2
    lifted = np.degrees(np.arctan2([-3.0, 1.0], 47.0))
    rows = np.count_nonzero((PANDAR64.elevations_deg > lifted[0]) & (PANDAR64.elevations_deg < lifted[1]))
    assert len(seen.points_level) == pytest.approx(columns * rows, rel=0.05)


@pytest.mark.parametrize(
    ("heading_deg", "bearing_deg", "aspect_deg"),
    [(180, 0, 0), (0, 0, 180), (90, 0, 90), (-90, 0, 90), (-90, 90, 0), (45, 45, 180), (135, 0, 45)],
)
def test_aspect_is_the_angle_between_the_bow_and_the_line_of_sight(heading_deg, bearing_deg, aspect_deg):
    placement = Placement(40.0, np.radians(heading_deg), np.radians(bearing_deg))
    assert placement.aspect_deg == pytest.approx(aspect_deg, abs=1e-6)


def test_bow_points_along_the_heading_and_the_vessel_lies_along_the_bearing():
    pose = Placement(40.0, np.radians(30), np.radians(90), 3.0).T_level_vessel()
    assert pose[:3, 3] == pytest.approx([0.0, 40.0, -3.0])
    assert pose[:3, 0] == pytest.approx([np.cos(np.pi / 6), 0.5, 0.0])
    assert pose[:3, 1] == pytest.approx([-0.5, np.cos(np.pi / 6), 0.0])


def test_roll_lifts_port_pitch_sinks_the_bow_heave_lifts_all():
    pose = Placement(40.0, 1.0).T_level_vessel(Motion(roll=0.1, pitch=0.2, heave=0.5))
    assert pose[2, 1] > 0.0
    assert pose[2, 0] < 0.0
    assert pose[2, 3] == pytest.approx(-2.5)


@settings(max_examples=30, deadline=None)
@given(
    range_m=st.floats(20.0, 150.0),
    heading=st.floats(-3.14, 3.14),
    bearing=st.floats(-3.14, 3.14),
    height=st.floats(2.0, 6.0),
    seed=st.integers(0, 1000),
)
def test_pose_takes_surface_points_to_the_level_points(range_m, heading, bearing, height, seed):
    sea = Conditions(sea=SeaState(3.0, 2.0, 0.3))
    seen = scan(Placement(range_m, heading, bearing, height), conditions=sea, seed=seed)
    points = to_vessel(seen.T_level_vessel, seen.points_level.astype(float))
    outside = np.abs(points - [0, 0, 2.0]) - [10.0, 3.0, 2.0]
    assert len(points) > 0
    assert np.abs(outside.max(axis=1)).max() < 1e-3
    assert seen.T_level_vessel[:3, :3] @ seen.T_level_vessel[:3, :3].T == pytest.approx(np.eye(3))


def test_waterline_is_at_minus_the_sensor_height():
    heights = scan(Placement(30.0, np.pi / 2, 0.0, 4.5)).points_level[:, 2]
    assert -4.5 <= heights.min() < -4.3


def test_a_rolling_vessel_shows_nothing_below_the_water():
    rolling = Conditions(sea=SeaState(15.0, 8.0, 1.0))
    for seed in range(10):
        assert scan(Placement(25.0, 1.0), conditions=rolling, seed=seed).points_level[:, 2].min() >= -3.0


def test_a_heaved_hull_shows_its_wetted_side():
    open_below = Vessel("cut", box_hull().mesh.slice_plane([0, 0, 1e-9], [0, 0, 1]))
    lifted = Conditions(sea=SeaState(0.0, 0.0, 0.4))
    raised = scan(Placement(25.0, np.pi / 2), conditions=lifted, vessel=with_skirt(open_below), seed=21)
    points = to_vessel(raised.T_level_vessel, raised.points_level.astype(float))
    assert raised.T_level_vessel[2, 3] == pytest.approx(-3.0 + 0.67, abs=0.01)
    assert np.abs(points[:, 1]) == pytest.approx(3.0, abs=1e-4)
    assert -0.67 <= points[:, 2].min() < -0.5
    assert with_skirt(open_below).box == pytest.approx(open_below.box)


def test_noise_lies_along_the_ray_with_its_standard_deviation():
    placement = Placement(30.0, np.pi / 2)
    # Raised, or noise would push some of the lowest row into the water and out of the cluster.
    raised = Vessel("raised", box_hull().mesh.apply_translation([0.0, 0.0, 0.5]))
    clean, noisy = (scan(placement, lidar=perfect_lidar(sd), vessel=raised) for sd in (0.0, 0.05))
    far = [np.linalg.norm(cloud.points_level, axis=1) for cloud in (clean, noisy)]
    assert len(far[0]) == len(far[1])
    cross = np.linalg.norm(np.cross(clean.points_level, noisy.points_level), axis=1) / (far[0] * far[1])
    assert cross.max() < 1e-5
    assert np.std(far[1] - far[0]) == pytest.approx(0.05, rel=0.05)
    assert np.mean(far[1] - far[0]) == pytest.approx(0.0, abs=0.003)


def test_same_generator_state_gives_the_same_cluster_and_another_seed_another():
    placement = Placement(60.0, 0.3)
    rough = Conditions(sea=SeaState(2.0, 1.0, 0.1), dropout=0.1)
    first, again, other = (scan(placement, conditions=rough, lidar=PANDAR64, seed=s) for s in (1, 1, 2))
    assert np.array_equal(first.points_level, again.points_level)
    assert not np.array_equal(first.points_level, other.points_level)


@pytest.mark.parametrize(
    ("conditions", "share"),
    [(Conditions(dropout=0.3), 0.3), (Conditions(dropout_per_100m=1.0), 0.3), (Conditions(dropout=1.0), 1.0)],
)
def test_dropout_takes_its_share(conditions, share):
    placement = Placement(33.0, np.pi / 2)
    left = len(scan(placement, conditions=conditions).points_level) / len(scan(placement).points_level)
    assert 1 - left == pytest.approx(share, abs=0.03)


def test_an_occluder_leaves_its_shadow():
    placement = Placement(50.0, np.pi / 2)
    wall = BoxOccluder(low=(20.0, 0.0, -3.0), high=(21.0, 50.0, 10.0))
    seen = scan(placement, conditions=Conditions(occluders=(wall,))).points_level
    whole = scan(placement).points_level
    assert len(seen) == np.count_nonzero(whole[:, 1] < 0)
    assert seen[:, 1].max() < 0


def test_an_occluder_behind_the_vessel_changes_nothing():
    placement = Placement(50.0, np.pi / 2)
    wall = BoxOccluder(low=(60.0, -50.0, -3.0), high=(61.0, 50.0, 10.0))
    behind = scan(placement, conditions=Conditions(occluders=(wall,))).points_level
    assert np.array_equal(behind, scan(placement).points_level)


def test_another_hull_in_front_hides_what_lies_behind_it():
    ship = HullOccluder(box_hull(length=40.0, height=10.0), Placement(25.0, np.pi / 2))
    assert len(scan(Placement(60.0, 0.4), conditions=Conditions(occluders=(ship,))).points_level) == 0


def test_default_lidar_density_on_a_small_boat_far_and_a_ship_near():
    boat, ship = box_hull(9.0, 2.8, 1.3), box_hull(28.0, 10.0, 8.0)
    assert len(scan(Placement(110.0, np.pi / 2), lidar=PANDAR64, vessel=boat).points_level) >= 15
    assert len(scan(Placement(30.0, np.pi / 2), lidar=PANDAR64, vessel=ship).points_level) >= 1000
