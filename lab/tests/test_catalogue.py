from pathlib import Path

import numpy as np
import pytest
from hulls import box_hull

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

from shipshape.types import ImageMethod
from shipshape_lab.simulator import clusters, datasets
from shipshape_lab.simulator.catalogue import DEFAULT, read_catalogue, same_vessels
from shipshape_lab.simulator.vessels import VESSEL_TYPES, build_vessel
from shipshape_lab.training import train_all
from shipshape_lab.training.build_bundle import build
from shipshape_lab.training.examples import Examples
from shipshape_lab.training.partial import partial_bundle

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "vessels"

# A box that is 20 x 6 x 4 m of millimetres, floating 1 m deep, beside a generated tug.
FLEET = """
[[vessel]]
name = "barge"
mesh = "meshes/barge.stl"
scale = 0.001
waterline = 1.0

[[vessel]]
name = "harbour_tug"
type = "tug"

[[vessel]]
name = "pontoon"
mesh = "meshes/pontoon.obj"
"""
NAMES = ("barge", "harbour_tug", "pontoon")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "meshes").mkdir()
    box_hull().mesh.apply_scale(1000.0).export(folder / "meshes/barge.stl")
    box_hull(9.0, 4.0, 1.5).mesh.export(folder / "meshes/pontoon.obj")
    (folder / "fleet.toml").write_text(FLEET)
    return folder


@pytest.fixture(scope="module")
def fleet(folder):
    return read_catalogue(folder / "fleet.toml")


@pytest.fixture(scope="module")
def data(folder):
    """A folder with a training set of 64 clusters and a validation set of 12, made by the command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(datasets, "SURFACE_POINTS", 300)
        order = ["--catalogue", str(folder / "fleet.toml"), "--out", str(folder / "data"), "--count"]
        datasets.main(["train", *order, "64"])
        datasets.main(["validation", *order, "12"])
    return folder / "data"


def test_entries_keep_their_order_and_names(fleet):
    assert fleet.names == NAMES
    assert fleet.classes[:3] == NAMES
    assert "tug" not in fleet.classes
    assert "rhib" in fleet.others


def test_scale_and_waterline_make_the_box(fleet):
    sizes = [(box.length, box.beam, box.height) for box in fleet.boxes()]
    assert sizes[0] == pytest.approx((20.0, 6.0, 3.0), abs=1e-3)
    assert sizes[1] == build_vessel("tug").box
    assert sizes[2] == pytest.approx((9.0, 4.0, 1.5), abs=1e-3)


def test_a_generated_entry_is_the_generators_hull_under_its_own_name(fleet):
    for seed in (None, 7):
        vessel = fleet.build("harbour_tug", seed)
        assert (vessel.name, vessel.seed) == ("harbour_tug", seed)
        assert np.array_equal(vessel.mesh.vertices, build_vessel("tug", seed).mesh.vertices)
    assert DEFAULT.build("rhib", 3).box == build_vessel("rhib", 3).box


def test_sisters_of_a_mesh_vary_modestly_and_repeatably(fleet):
    nominal = np.array(fleet.build("barge").box)
    ratios = np.array([fleet.build("barge", seed).box for seed in range(60)]) / nominal
    assert np.abs(ratios - 1.0).max() <= 0.06 + 1e-9
    assert ratios.std(axis=0) == pytest.approx(0.03, abs=0.01)
    assert fleet.build("barge", 4).box == fleet.build("barge", 4).box
    assert fleet.build("barge", 4).mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-6)
    pontoon = np.array(fleet.build("pontoon", 4).box) / np.array(fleet.build("pontoon").box)
    assert not np.allclose(pontoon, ratios[4])


def test_names_that_a_mesh_takes_are_no_longer_outside(folder):
    path = folder / "named.toml"
    path.write_text('[[vessel]]\nname = "small_ferry"\nmesh = "meshes/barge.stl"\nscale = 0.001\n')
    assert read_catalogue(path).classes.count("small_ferry") == 1


@pytest.mark.skipif(not DATA.is_dir(), reason="shared/data/vessels is not beside the repository")
def test_a_real_mesh_can_be_an_entry(tmp_path):
    path = tmp_path / "real.toml"
    path.write_text(f'[[vessel]]\nname = "oc_tug"\nmesh = "{DATA.as_posix()}/oc_tugboat.ply"\n')
    catalogue = read_catalogue(path)
    (box,) = catalogue.boxes()
    assert (box.length, box.beam, box.height) == pytest.approx((24.0, 10.44, 11.77), abs=0.2)
    made = datasets.make(datasets.Job("train", 2, 1, catalogue), progress=False)
    assert made.n.min() >= 10


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("vessel", "could not be read as a TOML file"),
        ("", "must hold .*vessel.* tables"),
        ('title = "x"\n' + FLEET, "nothing else"),
        ("vessel = [1]", "plain values"),
        ('[[vessel]]\ntype = "tug"', "vessel 1 must have a name"),
        ('[[vessel]]\nname = "unknown"\ntype = "tug"', "name other than 'unknown'"),
        ('[[vessel]]\nname = "a"', "either a type or a mesh"),
        ('[[vessel]]\nname = "a"\ntype = "tug"\nmesh = "meshes/barge.stl"', "either a type or a mesh"),
        ('[[vessel]]\nname = "a"\ntype = "galleon"', "one of the types rhib, .* but has 'galleon'"),
        ('[[vessel]]\nname = "a"\ntype = "tug"\nscale = 2', r"but has \['scale'\] too"),
        ('[[vessel]]\nname = "a"\nmesh = "gone.ply"', "mesh file relative to .* but has 'gone.ply'"),
        ('[[vessel]]\nname = "a"\nmesh = "meshes/barge.stl"\nscale = 0', "positive scale, but has 0"),
        ('[[vessel]]\nname = "a"\nmesh = "meshes/barge.stl"\nscale = nan', "finite number as scale"),
        ('[[vessel]]\nname = "a"\nmesh = "meshes/barge.stl"\nwaterline = "1"', "finite number as waterline"),
        ('[[vessel]]\nname = "a"\nmesh = "meshes/barge.stl"\nup = "w"', "one of x, -x, .* as up, but has 'w'"),
        ('[[vessel]]\nname = "a"\nmesh = "meshes/barge.stl"\nbow = "-z"', "two different axes, got -z and z"),
        (FLEET + FLEET.replace('"tug"', '"rhib"'), "name of its own, but has barge, harbour_tug, pontoon twice"),
        (FLEET + '[[vessel]]\nname = "b"\ntype = "tug"', "type of its own, but has tug twice"),
        ("".join(f'[[vessel]]\nname = "{n}"\ntype = "{n}"\n' for n in VESSEL_TYPES), "leave out one"),
    ],
)
def test_mistakes_get_one_sentence(folder, text, complaint):
    path = folder / "mistaken.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=complaint) as caught:
        read_catalogue(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_gets_one_sentence(folder):
    with pytest.raises(ValueError, match=r"gone\.toml could not be read"):
        read_catalogue(folder / "gone.toml")


def test_the_command_tells_a_bad_mesh_before_it_starts(folder, capsys):
    path = folder / "huge.toml"
    path.write_text(FLEET.replace("0.001", "1.0"))
    with pytest.raises(SystemExit):
        datasets.main(["train", "--catalogue", str(path), "--out", str(folder / "never"), "--count", "2"])
    assert "give its scale" in capsys.readouterr().err
    assert not (folder / "never").exists()


def test_a_set_carries_its_catalogue(fleet, data):
    made = clusters.load(data / "train.npz")
    assert made.vessels == clusters.load_catalogue(data / "train.npz") == fleet.vessels()
    assert tuple(made.classes) == fleet.classes
    assert {made.name(i) for i in range(len(made))} > set(NAMES)


def test_a_set_of_another_catalogue_is_left_alone(data, capsys):
    before = (data / "validation.npz").read_bytes()
    with pytest.raises(SystemExit):
        datasets.main(["validation", "--out", str(data), "--count", "12"])
    assert "but is of barge, harbour_tug, pontoon" in capsys.readouterr().err
    assert (data / "validation.npz").read_bytes() == before


def test_training_from_nothing_keeps_sets_of_another_catalogue(data, tmp_path, monkeypatch):
    made = []
    monkeypatch.setattr(train_all, "_run", lambda module, arguments, work, name: made.append(name))
    train_all.make_data("train", data.parent, 1)
    assert made == []
    train_all.make_data("train", tmp_path, 1)
    assert made == ["data_train"]


def test_a_set_that_does_not_say_has_the_default_catalogue(tmp_path):
    made = datasets.make(datasets.Job("train", 3, 1), progress=False)
    clusters.save(tmp_path / "new.npz", made)
    with np.load(tmp_path / "new.npz") as arrays:
        old = {name: arrays[name] for name in arrays.files if name not in ("catalogue", "boxes")}
    np.savez(tmp_path / "old.npz", **old)
    assert clusters.load(tmp_path / "old.npz").vessels == DEFAULT.vessels()
    assert clusters.load_catalogue(tmp_path / "old.npz") == DEFAULT.vessels()


def test_other_boxes_or_names_are_another_catalogue(fleet):
    assert same_vessels(fleet.vessels(), fleet.vessels())
    assert not same_vessels(fleet.vessels(), fleet.vessels()[:2])
    assert not same_vessels(fleet.vessels(), fleet.vessels()[::-1])


def test_the_grid_is_of_the_catalogue(fleet):
    grid = datasets.make(datasets.Job("P", 2, 3, fleet), progress=False)
    assert [grid.name(i) for i in range(2)] == ["barge", "barge"]


def test_labels_follow_the_catalogue(data):
    examples = Examples.read(data, "train")
    for i in examples.indices:
        name = examples.clusters.name(int(i))
        expected = NAMES.index(name) if name in NAMES else len(NAMES)
        assert examples.example(int(i)).label == expected
    known = Examples.read(data, "train", catalogue_only=True)
    assert known.labels[known.indices].max() == len(NAMES) - 1
    assert examples.labels.max() == len(NAMES)


def script(name):
    return pytest.importorskip(f"shipshape_lab.training.{name}", reason="torch is missing: make torch adds it")


def test_training_items_can_be_made(data, tmp_path):
    aligned, inpainting, grey, points, spd2 = (
        script(f"train_{name}") for name in ("aligned", "inpainting", "grey", "points", "spd2")
    )
    examples = Examples.read(data, "train", catalogue_only=True)
    rng = np.random.default_rng(0)
    example = examples.drawn(int(examples.indices[0]), rng)
    assert aligned.to_item(example, aligned.guess(example, rng))["label"] == example.label
    assert inpainting.to_item(example, inpainting.guess(example, rng))["occupied"].any()
    assert grey.to_item(example, ImageMethod.FULL_SIDE, examples.boxes)["whole"].any()
    assert points.to_item(example)["near"].any()
    for model, classes in (("parts", 3), ("prior", len(NAMES) + 1)):
        describe, count = spd2.source(model, tmp_path, examples.catalogue)
        images, labels = describe(example, rng)
        assert count == classes
        assert len(images) == len(labels) > 0


# torch says at every export that it has a newer exporter too.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_network_learns_the_classes_of_its_data(data, tmp_path):
    train_aligned = script("train_aligned")
    train_aligned.main(["--data", str(data), "--out", str(tmp_path), "--epochs", "1", "--threads", "1"])
    bundle = partial_bundle(tmp_path / "bundle", clusters.load_catalogue(data / "validation.npz"))
    assert tuple(vessel.name for vessel in bundle.catalogue) == NAMES
    planes, features = np.zeros((1, 9, 32, 64), np.float32), np.zeros((1, 3), np.float32)
    *_, classes = bundle.models["aligned"].run(planes=planes, features=features)
    assert classes.shape == (1, len(NAMES) + 1)


def test_networks_of_another_catalogue_make_no_bundle(data, tmp_path):
    for kind in ("validation.npz", "validation_surfaces.npz"):
        (tmp_path / kind).write_bytes((data / kind).read_bytes())
    clusters.save(tmp_path / "train.npz", datasets.make(datasets.Job("train", 2, 1), progress=False))
    with pytest.raises(ValueError, match=r"must hold one catalogue, but train has rhib, .* validation barge"):
        build(tmp_path, tmp_path, tmp_path / "bundle", seed=1)
