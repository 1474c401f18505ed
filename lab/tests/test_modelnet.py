"""Experiment 1 on shapes made here; ModelNet40's own are read where the data lie beside the checkout."""

import importlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from shipshape.errors import BundleError
from shipshape.onnx_model import OnnxModel
from shipshape.types import ImageMethod
from shipshape_lab.experiments import modelnet
from shipshape_lab.experiments.pages import modelnet as page
from shipshape_lab.metrics import CompleteSurface, chamfer_l1
from shipshape_lab.modelnet import examples, masks, methods
from shipshape_lab.modelnet.examples import Masked
from shipshape_lab.modelnet.methods import BEST, METHODS, GreyMethod, LayersMethod
from shipshape_lab.modelnet.shapes import KINDS, Shape, Split, read_shapes, standing, turned

TRAIN = ["--method", "full_top", "--method", BEST, "--epochs", "1"]
MODELNET = Path(__file__).parents[3] / "shared/data/modelnet"


def cross(count: int = 6_000) -> np.ndarray:
    """A flat "airplane", z up, nose to +x: fuselage 2 long, swept wings 2.4 wide; symmetric about y = 0 alone."""
    rng = np.random.default_rng(0)
    along, across = rng.uniform(-1, 1, count // 2), rng.uniform(-1.2, 1.2, count // 2)
    fuselage = np.stack([along, rng.uniform(-0.1, 0.1, count // 2), rng.uniform(0, 0.2, count // 2)], axis=1)
    wing = np.stack(
        [0.1 - 0.5 * abs(across) + rng.uniform(-0.1, 0.1, count // 2), across, np.full(count // 2, 0.1)], axis=1
    )
    return np.concatenate([fuselage, wing])


def shape(name: str = "airplane_0001") -> Shape:
    return Shape(name, standing(cross()))


def write_files(folder: Path, shapes: dict[str, np.ndarray], test: list[str]) -> None:
    """Shapes (z up) as the data set has them: y up, whole numbers."""
    y_up = np.stack([points[:, [1, 2, 0]] for points in shapes.values()])
    np.savez(
        folder / "modelnet40_some_int16.npz",
        points_q=np.rint(y_up * 16_000).astype(np.int16),
        scale=np.float32(1 / 16_000),
        names=np.array(list(shapes)),
    )
    (folder / "modelnet40_train.txt").write_text("\n".join(set(shapes) - set(test)))
    (folder / "modelnet40_test.txt").write_text("\n".join(test))


@pytest.mark.parametrize("turn_deg", [0.0, 37.0, 90.0, 161.0])
def test_airplanes_are_turned_lengthwise_though_their_wings_are_wider(tmp_path, turn_deg):
    write_files(tmp_path, {"airplane_0001": turned(cross(), np.radians(turn_deg))}, ["airplane_0001"])
    (found,) = read_shapes(tmp_path, Split.TEST)
    length, beam, height = np.ptp(found.points, axis=0)
    assert_allclose([length, beam, height], [2.0, 2.4, 0.2], atol=0.06)
    assert found.points[:, 2].min() == 0.0


def test_other_shapes_have_their_longer_side_along_x(tmp_path):
    box = np.random.default_rng(0).uniform([-0.3, -0.9, 0.0], [0.3, 0.9, 0.4], (4_000, 3))
    write_files(tmp_path, {"bathtub_0001": turned(box, 0.3)}, ["bathtub_0001"])
    (found,) = read_shapes(tmp_path, Split.TEST)
    assert_allclose(np.ptp(found.points, axis=0), [1.8, 0.6, 0.4], atol=0.06)


def test_a_shape_is_read_from_the_list_that_names_it_and_other_kinds_are_not(tmp_path):
    shapes = dict.fromkeys(("airplane_0001", "airplane_0002", "chair_0001"), cross())
    write_files(tmp_path, shapes, ["airplane_0002"])
    assert [s.name for s in read_shapes(tmp_path, Split.TRAIN)] == ["airplane_0001"]
    assert [s.name for s in read_shapes(tmp_path, Split.TEST)] == ["airplane_0002"]


def test_a_folder_without_shapes_is_told(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"expected modelnet40_\*_int16.npz and modelnet40_test.txt"):
        read_shapes(tmp_path, Split.TEST)


@pytest.mark.skipif(not MODELNET.exists(), reason="the ModelNet40 shapes are not beside this checkout")
def test_modelnet_has_the_shapes_that_the_page_tells_of():
    test = read_shapes(MODELNET, Split.TEST)
    count = {kind: sum(s.kind == kind for s in test) for kind in KINDS}
    assert count == {"airplane": 100, "bathtub": 50, "guitar": 2, "toilet": 1}
    assert not {s.name for s in test} & set((MODELNET / "modelnet40_train.txt").read_text().split())


@pytest.mark.parametrize("mask", list(masks.MASKS))
def test_a_mask_takes_its_share_the_same_in_every_run(mask):
    points = shape().points
    for rate in masks.RATES:
        left = masks.kept(points, mask, rate, masks.chance("airplane_0001", mask, rate, 1))
        assert left.sum() == round(len(points) * (100 - rate) / 100)
        again = masks.kept(points, mask, rate, masks.chance("airplane_0001", mask, rate, 1))
        other = masks.kept(points, mask, rate, masks.chance("airplane_0001", mask, rate, 2))
        assert (left == again).all()
        assert (left != other).any()
    assert masks.kept(points, mask, 100.0, np.random.default_rng(0)).sum() == 1


def test_each_mask_takes_what_its_name_says():
    points = shape().points
    middle = (points.max(axis=0) + points.min(axis=0)) / 2

    def left_and_lost(mask: str) -> tuple[np.ndarray, np.ndarray]:
        left = masks.kept(points, mask, 50, np.random.default_rng(3))
        return points[left], points[~left]

    left, lost = left_and_lost("centre")
    assert np.linalg.norm(lost - middle, axis=1).mean() < 0.6 * np.linalg.norm(left - middle, axis=1).mean()
    left, lost = left_and_lost("single_side")
    across = np.linalg.lstsq(np.c_[points[:, :2], np.ones(len(points))], np.isin(points, left).all(axis=1) - 0.5)[
        0
    ]
    assert (np.c_[left[:, :2], np.ones(len(left))] @ across > -0.2).all()  # a straight line parts the two
    assert (np.c_[lost[:, :2], np.ones(len(lost))] @ across < 0.2).all()
    left, lost = left_and_lost("random")
    assert_allclose(left.mean(axis=0), lost.mean(axis=0), atol=0.05)


def test_validation_shapes_are_not_learned_from_and_the_few_are_drawn_more_often():
    train = [Shape(f"airplane_{i:04}", cross(50)) for i in range(40)] + [Shape("guitar_0001", cross(50))]
    learned, validation = examples.split_validation(train)
    assert len(validation) == 4
    assert {s.name for s in learned} | {s.name for s in validation} == {s.name for s in train}
    assert len(learned) + len(validation) == len(train)
    assert "guitar_0001" in {s.name for s in learned}
    drawn = [s.name for s in examples.schedule(learned)]
    assert drawn.count("guitar_0001") == 10 * drawn.count(learned[0].name)


def test_a_drawn_example_shows_part_of_the_shape_that_it_is_to_become():
    masked = Masked.drawn(shape(), np.random.default_rng(0))
    whole = {tuple(point) for point in masked.shape.points.tolist()}
    assert {tuple(point) for point in masked.points.tolist()} < whole
    for method in ImageMethod:
        item = examples.grey_item(masked, method)
        assert ((item["image"] > 0) <= (item["whole"] > 0)).all()
    item = examples.layers_item(masked)
    assert (item["planes"][:3] <= item["occupied"]).all()
    assert item["planes"].shape == (18, 64, 64)
    assert (item["bottom"] <= item["top"]).all()


def test_the_round_trip_of_every_image_stays_within_a_cell_of_the_shape():
    whole, nothing = shape(), None
    truth = CompleteSurface(whole.points, whole.extent)
    for method in ImageMethod:
        lifted = GreyMethod(method, nothing, 0.1).round_trip(whole.points, whole.pose)
        assert chamfer_l1(truth.nearest(lifted)) < 0.03
        assert truth.nearest(lifted).to_surface.max() < 0.05
    lifted = LayersMethod(nothing).round_trip(whole.points, whole.pose)
    assert chamfer_l1(truth.nearest(lifted)) < 0.01


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Folder of shapes, and networks that learned from them for a moment; the other views borrow full_top's."""
    train = pytest.importorskip("shipshape_lab.modelnet.train", reason="needs torch", exc_type=ImportError)
    folder = tmp_path_factory.mktemp("modelnet")
    names = [f"airplane_{i:04}" for i in range(13)]  # 10 to learn from, 2 to choose thresholds on, 1 to test
    write_files(folder, dict.fromkeys(names, cross(600)), names[-1:])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, "EMPTY_BELOW", (0.1, 0.9))
        train.main([*TRAIN, "--shapes", str(folder), "--out", str(folder / "networks")])
    for other in set(METHODS) - {"full_top", BEST}:
        for end in ("onnx", "json"):
            shutil.copy(folder / f"networks/full_top.{end}", folder / f"networks/{other}.{end}")
    return folder


def test_training_leaves_every_method_and_does_not_begin_again(trained, caplog):
    train = importlib.import_module("shipshape_lab.modelnet.train")
    restorers = methods.load(trained / "networks")
    assert list(restorers) == list(METHODS)
    assert restorers["full_top"].empty_below == 0.9  # a network that learned so little fills every cell at 0.1
    whole = shape()
    left = whole.points[::7]
    for restorer in restorers.values():
        assert restorer.restore(left, whole.pose).before.any()
    kept = restorers[BEST].restore(left, whole.pose).points[: len(left)]
    assert_allclose(kept, left, atol=1e-6)
    with caplog.at_level("INFO"):
        train.main([*TRAIN, "--shapes", str(trained), "--out", str(trained / "networks")])
    assert caplog.text.count("is trained already") == 2


def test_a_method_that_is_not_trained_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"expected method full_top in .*, got no full_top.json"):
        methods.load(tmp_path)


def test_the_experiment_leaves_numbers_and_a_section(trained, tmp_path):
    command = ["--shapes", str(trained), "--networks", str(trained / "networks"), "--out", str(tmp_path)]
    modelnet.main([*command, "--figures", str(tmp_path)])
    left = json.loads((tmp_path / "modelnet.json").read_text())
    numbers = left["numbers"]
    assert numbers["M.shapes"] == 1
    cells = [numbers[f"M.cd_l1.raw.{mask}_{rate}"] for mask in masks.MASKS for rate in masks.RATES]
    assert_allclose(numbers["M.cd_l1.raw.overall"], np.mean(cells), rtol=1e-4)
    assert numbers["M.points.raw.random_90"] == 60
    assert {f"modelnet_{mask}.png" for mask in masks.MASKS} < {file.name for file in tmp_path.glob("*.png")}
    section = page.section(numbers, left["about"])
    assert f"{numbers['M.cd_l1.best.overall']:.2f}" in section
    assert " - " not in section.split("\n\n")[2].splitlines()[-1]


def test_scores_are_not_computed_twice(tmp_path, monkeypatch):
    asked = []

    def score(of: Shape, *_: object) -> np.ndarray:
        asked.append(of.name)
        return np.full((len(modelnet.CELLS), len(modelnet.CLOUDS), len(modelnet.SCORES)), len(asked), np.float32)

    monkeypatch.setattr(modelnet, "score_shape", score)
    shapes, kept = [shape("airplane_0001"), shape("airplane_0002")], tmp_path / "modelnet.npz"
    first = modelnet.score_all(shapes, {}, 1, kept, "a key")
    assert (modelnet.score_all(shapes, {}, 1, kept, "a key") == first).all()
    assert asked == ["airplane_0001", "airplane_0002"]
    assert (modelnet.score_all(shapes, {}, 1, kept, "another key") != first).all()


def test_model_of_another_image_is_refused(trained):
    whole = shape()
    wrong = LayersMethod(OnnxModel(trained / "networks/full_top.onnx"))
    with pytest.raises(BundleError, match=r"expected full_top\.onnx to take planes"):
        wrong.restore(whole.points, whole.pose)
