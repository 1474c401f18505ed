from pathlib import Path

import numpy as np
import pytest
import trimesh

from shipshape_lab.fleet import command, mesh_checks
from shipshape_lab.fleet.checks import check_catalogue
from shipshape_lab.fleet.mesh_checks import check_mesh
from shipshape_lab.fleet.openings import seen_through
from shipshape_lab.simulator.catalogue import Catalogue, GeneratedVessel, MeshVessel
from shipshape_lab.simulator.mesh_files import MOST_TRIANGLES, Placing, thinned
from shipshape_lab.simulator.skirt import with_skirt
from shipshape_lab.simulator.vessel import Vessel
from shipshape_lab.simulator.vessels import VESSEL_TYPES, build_vessel

NOT_TURNED = Placing()
DATA = Path(__file__).parents[2].parent / "shared" / "data" / "vessels"


@pytest.fixture
def tug():
    """24 m long, 2 m deep, as a user should hand it in."""
    return with_skirt(build_vessel("tug")).mesh


@pytest.fixture
def check(tmp_path):
    """What is said of a mesh, once as it is and once with a placing."""

    def check_file(mesh, placing=NOT_TURNED, name="boat"):
        path = tmp_path / f"{name}.ply"
        mesh.export(path)
        return [str(finding) for finding in check_mesh(MeshVessel(name, path, placing))[0]]

    return check_file


def turned(mesh, rows):
    return trimesh.Trimesh(mesh.vertices @ np.array(rows, float).T, mesh.faces, process=False)


def test_a_sound_mesh_passes(check, tug):
    assert check(tug) == []


@pytest.mark.parametrize("name", VESSEL_TYPES)
def test_every_generated_hull_passes(check, name):
    assert check(with_skirt(build_vessel(name, 5)).mesh) == []


@pytest.mark.parametrize(("factor", "scale"), [(1000.0, 0.001), (100.0, 0.01), (0.001, 1000.0)])
def test_wrong_units_are_named_and_the_advice_helps(check, tug, factor, scale):
    mesh = tug.copy().apply_scale(factor)
    (said,) = check(mesh)
    assert "expected 2 to 150 m" in said
    assert f"scale = {scale:g} if its unit is" in said
    assert check(mesh, Placing(scale=scale)) == []


Y_UP = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # as many drawing programs have it
BOW_UP = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
ALONG_Y = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]


@pytest.mark.parametrize(
    ("rows", "what", "placing"),
    [
        (Y_UP, "does not have z up", Placing(bow="x", up="y")),
        (BOW_UP, "does not have z up", Placing(bow="z", up="-x")),
        (ALONG_Y, "lies along y", Placing(bow="y", up="z")),
    ],
)
def test_turned_axes_are_named_and_the_advice_helps(check, tug, rows, what, placing):
    (said,) = check(turned(tug, rows))
    assert what in said
    for key, axis in (("bow", placing.bow), ("up", placing.up)):
        assert f'{key} = "{axis.removeprefix("-")}"' in said
    assert check(turned(tug, rows), placing) == []


def test_a_bow_at_the_wrong_end_is_named_and_the_advice_helps(check, tug):
    reversed_tug = turned(tug, [[-1, 0, 0], [0, -1, 0], [0, 0, 1]])
    (said,) = check(reversed_tug)
    assert said.startswith("warning")
    assert 'give bow = "-x"' in said
    assert check(reversed_tug, Placing(bow="-x")) == []


@pytest.mark.parametrize(
    ("lift", "complaint"),
    [
        (10.0, "wholly above its waterline of 0 m, expected between 8.00 and"),
        (-30.0, "wholly below its waterline of 0 m, expected between -32.00 and"),
        (-7.0, "under water: check its waterline"),
    ],
)
def test_a_wrong_waterline_is_named_and_the_advice_helps(check, tug, lift, complaint):
    mesh = tug.copy().apply_translation([0.0, 0.0, lift])
    (said,) = check(mesh)
    assert complaint in said
    assert check(mesh, Placing(waterline=lift)) == []


def test_holes_are_found(check, tug):
    middles = tug.triangles_center
    wound = (middles[:, 1] > 2.0) & (middles[:, 0] < 0.0)
    (said,) = check(trimesh.Trimesh(tug.vertices, tug.faces[~wound], process=False))
    assert "from inside too: close its holes" in said


def test_a_closed_box_shows_no_inside_and_an_open_one_does():
    box = trimesh.creation.box([20.0, 6.0, 4.0]).apply_translation([0, 0, 2.0])
    assert seen_through(Vessel("box", box)) == 0.0
    wall = box.face_normals[:, 1] > 0.5
    assert seen_through(Vessel("box", trimesh.Trimesh(box.vertices, box.faces[~wall]))) > 0.3


def test_too_many_triangles_are_thinned(check, tug, monkeypatch):
    fine = tug.subdivide().subdivide()
    assert len(fine.faces) > MOST_TRIANGLES
    monkeypatch.setattr(mesh_checks, "MOST_TRIANGLES", MOST_TRIANGLES // 3)
    (said,) = check(fine)
    assert said.startswith("warning")
    assert "triangles, more than a LiDAR can tell" in said
    small, cell = thinned(fine)
    assert len(small.faces) <= MOST_TRIANGLES
    assert small.bounds == pytest.approx(fine.bounds, abs=2 * cell)
    assert small.area == pytest.approx(fine.area, rel=0.05)


def test_flat_empty_and_broken_files_are_refused(check, tug, tmp_path):
    (flat,) = check(turned(tug, [[1, 0, 0], [0, 1, 0], [0, 0, 0]]))
    assert "is flat" in flat
    (tmp_path / "none.ply").write_bytes(b"ply\n")
    ((said,), vessel) = check_mesh(MeshVessel("none", tmp_path / "none.ply"))
    assert vessel is None
    assert said.stops
    assert "cannot be used" in said.text


def test_two_meshes_alike_are_named(tug, tmp_path):
    tug.export(tmp_path / "tug.ply")
    tug.copy().apply_scale([1.01, 0.99, 1.01]).export(tmp_path / "sister.ply")
    entries = [MeshVessel(name, tmp_path / f"{name}.ply") for name in ("tug", "sister")]
    (said,) = check_catalogue(Catalogue((*entries, GeneratedVessel("pilot", "pilot_boat"))))
    assert str(said).startswith("warning: tug and sister differ by")


@pytest.mark.skipif(not DATA.is_dir(), reason="shared/data/vessels is not beside the repository")
def test_real_meshes_pass():
    meshes = sorted(DATA.glob("*.ply"))
    said = check_catalogue(Catalogue(tuple(MeshVessel(path.stem, path) for path in meshes)))
    # Two naval ships of one length that a LiDAR can hardly tell apart, and two finely meshed yachts.
    assert sorted(finding.vessel for finding in said) == [
        "bc_hmas_armidale",
        "oc_sailboat_mr00t",
        "oc_trawleryacht",
    ]
    assert not any(finding.stops for finding in said)


def test_the_command_stops_at_errors_and_if_strict_at_warnings(tug, tmp_path, capsys):
    tug.copy().apply_scale(1000.0).export(tmp_path / "tug.ply")
    path = tmp_path / "fleet.toml"
    path.write_text('[[vessel]]\nname = "tug"\nmesh = "tug.ply"\n')
    with pytest.raises(SystemExit):
        command.main([str(path), "--to", str(tmp_path / "bundle")])
    told = capsys.readouterr()
    assert "error: tug is 2" in told.out
    assert "expected meshes without errors" in told.err
    assert not (tmp_path / "bundle-work").exists()
    turned(tug, [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]).export(tmp_path / "tug.ply")
    command.main([str(path), "--check"])
    assert "1 vessels checked, 1 warnings" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        command.main([str(path), "--check", "--strict"])
