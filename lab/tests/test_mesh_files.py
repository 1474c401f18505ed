import importlib.util
from pathlib import Path

import numpy as np
import pytest
from hulls import box_hull

from shipshape_lab.simulator.mesh_files import Placing, load_vessel, read_placed

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "vessels"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="shared/data/vessels is not beside the repository")


@pytest.fixture
def write(tmp_path):
    def write_box(suffix, mesh=None):
        path = tmp_path / f"barge{suffix}"
        (mesh or box_hull().mesh.copy()).apply_translation([5.0, -2.0, -1.0]).export(path)
        return path

    return write_box


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
def test_a_box_is_cut_at_the_waterline_and_centred(write, suffix):
    vessel = load_vessel(write(suffix))
    assert vessel.name == "barge"
    assert vessel.box == pytest.approx((20.0, 6.0, 3.0), abs=1e-5)
    assert vessel.mesh.bounds == pytest.approx(np.array([[-10, -3, 0], [10, 3, 3]]), abs=1e-5)


def test_gltf_axes_are_turned(write):
    # As glTF lays a vessel out: x to port, y up, z to the bow.
    box = box_hull().mesh
    box.vertices = box.vertices[:, [1, 2, 0]]
    box.apply_translation([-5.0, 2.0, 1.0])
    assert load_vessel(write(".glb", box)).box == pytest.approx((20.0, 6.0, 4.0), abs=1e-5)


def test_bow_and_up_turn_the_file(write):
    # The bow at -y and up at -z, as a drawing seen from below may have it; scale and waterline come after.
    box = box_hull().mesh
    box.vertices = box.vertices @ np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    box.apply_translation([-5.0, 2.0, 1.0])
    path = write(".ply", box)
    placed = read_placed(path, Placing(scale=0.5, waterline=1.0, bow="-y", up="-z"))
    assert placed.extents == pytest.approx((10.0, 3.0, 2.0), abs=1e-5)
    assert placed.bounds[0, 2] == pytest.approx(-1.0, abs=1e-5)
    assert np.linalg.det(Placing(bow="-y", up="-z").rotation(".ply")) == pytest.approx(1.0)


def test_scale_and_waterline_apply(write):
    assert load_vessel(write(".ply"), scale=2.0, waterline=1.0).box == pytest.approx((40, 12, 5), abs=1e-4)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"waterline": 50.0}, "above the waterline"),
        ({"scale": 100.0}, "500 m long"),
        ({"scale": 0.01}, "1 to 500 m"),
    ],
)
def test_absurd_hulls_are_refused(write, options, complaint):
    with pytest.raises(ValueError, match=complaint):
        load_vessel(write(".ply"), **options)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj", ".glb", ".dae"])
def test_broken_files_are_refused(tmp_path, suffix):
    path = tmp_path / f"broken{suffix}"
    path.write_bytes(b"not a mesh at all")
    with pytest.raises(ValueError, match="broken"):
        load_vessel(path)


@pytest.mark.parametrize("name", ["gone.ply", "hull.pickle"])
def test_missing_files_and_other_formats_are_refused(tmp_path, name):
    with pytest.raises(ValueError, match=name):
        load_vessel(tmp_path / name)


@needs_data
@pytest.mark.parametrize(
    ("file", "box"),
    [
        ("bc_hurricane_rhib.ply", (9.9, 2.76, 4.53)),
        ("oc_tugboat.ply", (24.0, 10.44, 11.77)),
        ("WAM-V-Base.dae", (5.01, 2.49, 1.3)),
    ],
)
def test_real_meshes_have_their_size(file, box):
    assert load_vessel(DATA / file).box == pytest.approx(box, abs=0.2)


@needs_data
@pytest.mark.skipif(importlib.util.find_spec("DracoPy") is not None, reason="a Draco decoder is installed")
def test_a_draco_compressed_file_is_refused_by_name():
    with pytest.raises(ValueError, match="Draco"):
        load_vessel(DATA / "ship.glb")
