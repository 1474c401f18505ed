import numpy as np
import pytest
import trimesh

from shipshape_lab.simulator.render import contact_sheet, main
from shipshape_lab.simulator.vessels import (
    LENGTH_RANGE,
    VESSEL_TYPES,
    build_vessel,
    fishing_boat,
    landing_craft,
    motor_cruiser,
    patrol_boat,
    pilot_boat,
    rhib,
    sailing_yacht,
    small_ferry,
    tug,
)
from shipshape_lab.simulator.vessels.parts import block, rod
from shipshape_lab.simulator.vessels.shape import above_water
from shipshape_lab.simulator.vessels.variation import varied

# Length, beam, air height of the nominal hulls: (lowest, highest), metres.
NOMINAL_BOXES = {
    "rhib": ((8.5, 10.0), (2.4, 3.2), (3.0, 5.0)),
    "usv_catamaran": ((4.6, 5.6), (2.2, 2.7), (2.5, 3.5)),
    "motor_cruiser": ((10.5, 12.5), (3.2, 4.0), (4.0, 6.0)),
    "sailing_yacht": ((10.5, 12.5), (3.2, 3.8), (13.0, 17.0)),
    "fishing_boat": ((15.0, 17.0), (4.8, 5.8), (7.5, 10.0)),
    "pilot_boat": ((15.0, 17.0), (4.5, 5.4), (5.5, 7.5)),
    "tug": ((23.0, 25.0), (9.0, 10.5), (11.5, 14.5)),
    "patrol_boat": ((26.5, 28.5), (5.5, 6.5), (10.0, 13.0)),
    "landing_craft": ((17.0, 19.5), (5.0, 6.0), (6.0, 8.0)),
    "small_ferry": ((19.5, 21.5), (5.8, 6.8), (7.5, 9.5)),
}
MONOHULLS = {
    "rhib": rhib.Rhib(),
    "motor_cruiser": motor_cruiser.MotorCruiser(),
    "sailing_yacht": sailing_yacht.SailingYacht(),
    "fishing_boat": fishing_boat.FishingBoat(),
    "pilot_boat": pilot_boat.PilotBoat(),
    "tug": tug.Tug(),
    "patrol_boat": patrol_boat.PatrolBoat(),
    "landing_craft": landing_craft.LandingCraft(),
    "small_ferry": small_ferry.SmallFerry(),
}
POINTED = [name for name in MONOHULLS if name != "landing_craft"]
SEEDS = range(6)

every_type = pytest.mark.parametrize("name", VESSEL_TYPES)
every_monohull = pytest.mark.parametrize("name", list(MONOHULLS))


def test_there_are_ten_types():
    assert len(VESSEL_TYPES) == 10


@every_type
def test_nominal_box_is_within_its_stated_range(name):
    for side, (lowest, highest) in zip(build_vessel(name).box, NOMINAL_BOXES[name], strict=True):
        assert lowest <= side <= highest


@every_type
def test_every_sister_is_a_finite_mesh_in_the_vessel_frame(name):
    for seed in (None, *SEEDS):
        mesh = build_vessel(name, seed).mesh
        assert np.isfinite(mesh.vertices).all()
        assert 1000 <= len(mesh.faces) <= 8000
        assert mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(mesh.bounds[:, :2].sum(axis=0), 0.0, atol=1e-9)
        assert LENGTH_RANGE[0] - 1e-9 <= mesh.extents[0] <= LENGTH_RANGE[1] + 1e-9


@every_type
def test_a_seed_gives_the_same_hull_again(name):
    first, again = build_vessel(name, 5).mesh, build_vessel(name, 5).mesh
    np.testing.assert_array_equal(first.vertices, again.vertices)
    np.testing.assert_array_equal(first.faces, again.faces)


@every_type
def test_sisters_differ_about_as_much_as_stated(name):
    boxes = np.array([build_vessel(name, seed).box for seed in range(24)])
    nominal = np.array(build_vessel(name).box)
    spread = (boxes / nominal).std(axis=0)
    assert (spread > 0.03).all()
    assert (spread < 0.2).all()
    assert abs(np.corrcoef(boxes[:, 0], boxes[:, 1])[0, 1]) < 0.6  # length and beam are drawn independently


@every_monohull
def test_bare_hull_is_the_same_on_both_sides(name):
    vertices = MONOHULLS[name].hull.shape().vertices
    mirrored = vertices * np.array([1.0, -1.0, 1.0])
    starboard, port = ({tuple(row) for row in np.round(side, 6) + 0.0} for side in (vertices, mirrored))
    assert starboard == port


@pytest.mark.parametrize("name", POINTED)
def test_bow_is_at_positive_x(name):
    for seed in (None, *SEEDS):
        ahead, astern = (_hull_breadth(build_vessel(name, seed).mesh, side) for side in (1.0, -1.0))
        assert ahead < 0.75 * astern


def test_bow_ramp_of_the_landing_craft_is_at_positive_x_and_its_house_aft():
    for seed in (None, *SEEDS):
        vertices = build_vessel("landing_craft", seed).mesh.vertices
        assert vertices[vertices[:, 2] > 0.8 * vertices[:, 2].max(), 0].mean() < 0.0


def test_usv_floats_rise_towards_positive_x():
    mesh = build_vessel("usv_catamaran").mesh
    low = mesh.vertices[mesh.vertices[:, 2] < 0.6]
    assert low[low[:, 0] > 2.4, 2].min() > 0.2
    assert low[low[:, 0] < -2.4, 2].min() < 0.2


@every_monohull
def test_side_has_no_holes(name):
    vessel = MONOHULLS[name]
    for parameters in (vessel, *(varied(vessel, np.random.default_rng(seed)) for seed in range(3))):
        assert _hits_from_port(parameters).all()


@every_type
def test_seen_from_above_nothing_of_the_waterplane_is_open(name):
    mesh = build_vessel(name).mesh
    low = mesh.vertices[np.abs(mesh.vertices[:, 2]) < 1e-6]
    # Halfway between the centreline of each float or hull and its side, all along the middle.
    y = 0.4 * low[:, 1].max() if name != "usv_catamaran" else mesh.bounds[1, 1] - 0.24
    x = np.linspace(0.6 * low[:, 0].min(), 0.6 * low[:, 0].max(), 60)
    origins = np.column_stack([x, np.full(60, y), np.full(60, 50.0)])
    assert mesh.ray.intersects_any(origins, np.tile([0.0, 0.0, -1.0], (60, 1))).all()


def test_cutting_keeps_what_is_above_the_waterline():
    cube = above_water(block(2.0, 2.0, 2.0).moved(z=-0.5))
    assert cube.vertices[:, 2].min() == 0.0
    sides = cube.vertices[cube.faces]
    area = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(4 * 2.0 * 1.5 + 4.0)


def test_a_rod_is_as_long_and_as_thin_as_asked():
    pole = rod((0.0, 0.0, 1.0), (0.0, 0.0, 4.0), 0.05)
    np.testing.assert_allclose(np.ptp(pole.vertices, axis=0), [0.1, 0.1, 3.0], atol=0.02)


def test_unknown_type_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match=r"Unknown vessel type 'submarine': expected one of rhib, .*\.$"):
        build_vessel("submarine")


def test_contact_sheet_is_written(tmp_path):
    contact_sheet([("rhib", build_vessel("rhib").mesh)], tmp_path / "sheet.png", width=60)
    assert (tmp_path / "sheet.png").read_bytes().startswith(b"\x89PNG")


def test_absent_real_meshes_are_skipped_with_one_sentence(tmp_path, capsys):
    out = tmp_path / "out" / "sheet.png"
    assert main(["--out", str(out), "--real", str(tmp_path / "absent"), "--width", "40"]) == 0
    assert out.exists()
    assert "rendering the generated vessels only" in capsys.readouterr().err


def _hull_breadth(mesh, side):
    """Greatest breadth of the low part of the vessel in its last tenth towards `side` times x."""
    # Up to mid height of the bow: rails, masts and houses stand above it.
    low = mesh.vertices[mesh.vertices[:, 2] < 0.1 * mesh.extents[0]]
    end = low[side * low[:, 0] > 0.42 * mesh.extents[0]]
    return float(np.ptp(end[:, 1])) if len(end) else 0.0


def _hits_from_port(parameters):
    """Which of a fan of level rays from port, at three heights below the cap, meet the bare hull near its side."""
    hull, shape = parameters.hull, parameters.hull.shape()
    t, level = np.meshgrid(np.linspace(0.02, 0.9, 150), (0.15, 0.5, 0.95))
    targets = hull.skin(t.ravel(), level.ravel())
    origins = targets + np.array([0.0, 20.0, 0.0])
    mesh = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    spots, rays, _ = mesh.ray.intersects_location(
        origins, np.tile([0.0, -1.0, 0.0], (len(origins), 1)), multiple_hits=False
    )
    close = np.zeros(len(origins), bool)
    close[rays] = np.abs(spots[:, 1] - targets[rays, 1]) < 0.1
    return close
