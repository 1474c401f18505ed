import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from builders_models import CLASSES, PARAMETERS, untrained_bundle
from builders_onnx import CATALOGUE, doubling_onnx, write_tiny_bundle
from shipshape.bundle import CatalogueVessel, check_fit, load_bundle
from shipshape.bundle_writer import write_manifest
from shipshape.errors import BundleError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_tiny_bundle(tmp_path / "bundle")
    return tmp_path / "bundle"


def edit_manifest(folder: Path, old: str, new: str) -> None:
    path = folder / "manifest.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_what_was_written_is_read_back(folder):
    bundle = load_bundle(folder)
    assert bundle.name == "tiny"
    assert bundle.catalogue == CATALOGUE
    assert bundle.digest == hashlib.sha256((folder / "manifest.toml").read_bytes()).hexdigest()
    assert bundle.parameters == {"best": {"temperature": 1.5, "edges": [0, 1, 2]}}
    assert bundle.scores == {"accuracy": 0.98}
    assert bundle.training == {"commit": "0" * 40, "seed": 1}
    doubled, _ = bundle.models["prior"].run(x=np.ones((1, 3), np.float32))
    assert doubled.sum() == 6


def test_the_same_content_has_the_same_digest(folder, tmp_path):
    assert write_tiny_bundle(tmp_path / "again").digest == load_bundle(folder).digest


def test_whole_metres_may_be_written_as_integers(folder):
    edit_manifest(folder, "length = 9.0", "length = 9")
    assert load_bundle(folder).catalogue[0].box.length == 9.0


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("format = 1", "format = 2", "expected manifest.toml of format 1, got format 2"),
        ("format = 1\n", "", r"expected manifest.toml of format 1, got format \(none\)"),
        ("format = 1", "format 1", "expected manifest.toml to be TOML, got"),
        ('name = "tiny"\n', "", "expected the key name in manifest.toml, got none"),
        ("length = 9.0", "length = -9.0", "another value of catalogue.0.length in manifest.toml, got -9.0"),
        ("beam = 2.8, ", "", "expected the key catalogue.0.beam in manifest.toml, got none"),
        ('name = "rhib"', 'name = "tug"', "expected distinct catalogue names .* got tug, tug"),
        ('name = "rhib"', 'name = "unknown"', "expected distinct catalogue names .* got unknown, tug"),
        ('"prior.onnx"', '"../prior.onnx"', r"another value of models.prior.file .* got '../prior.onnx'"),
        ('"prior.onnx"', '"/etc/passwd"', r"another value of models.prior.file .* got '/etc/passwd'"),
        ('"prior.onnx"', '"other.onnx"', r"expected to read other.onnx in .* got: No such file"),
        ('name = "x"', 'name = "y"', r"prior.onnx to have the inputs y float32\[-1, 3\], got x float32"),
        ("[scores]", "[socres]", "another value of socres in manifest.toml"),
    ],
)
def test_a_damaged_manifest_is_refused_in_one_sentence(folder, old, new, sentence):
    edit_manifest(folder, old, new)
    with pytest.raises(BundleError, match=sentence) as caught:
        load_bundle(folder)
    assert "\n" not in str(caught.value)


def test_a_changed_model_is_refused_by_its_hash_before_it_is_parsed(folder):
    (folder / "prior.onnx").write_bytes(b"not even ONNX")
    with pytest.raises(BundleError, match=r"expected sha256 [0-9a-f]{64} of prior.onnx, got [0-9a-f]{64}"):
        load_bundle(folder)


def test_a_truncated_model_with_the_right_hash_is_refused(folder):
    whole = (folder / "prior.onnx").read_bytes()
    half = whole[: len(whole) // 2]
    (folder / "prior.onnx").write_bytes(half)
    edit_manifest(folder, hashlib.sha256(whole).hexdigest(), hashlib.sha256(half).hexdigest())
    with pytest.raises(BundleError, match=r"expected prior.onnx to be a complete ONNX file"):
        load_bundle(folder)


def test_a_missing_folder_a_file_and_an_empty_folder_are_refused(tmp_path):
    (tmp_path / "file").touch()
    for name, came in [("gone", "got nothing"), ("file", "got a file"), ("", "got: No such file")]:
        with pytest.raises(BundleError, match=came):
            load_bundle(tmp_path / name)


def test_manifest_bytes_that_are_not_text_are_refused(folder):
    (folder / "manifest.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(BundleError, match=r"expected manifest\.toml to be TOML"):
        load_bundle(folder)


def test_the_writer_refuses_a_model_outside_the_folder(tmp_path):
    (tmp_path / "prior.onnx").write_bytes(doubling_onnx())
    (tmp_path / "bundle").mkdir()
    with pytest.raises(BundleError, match="directly inside"):
        write_manifest(
            tmp_path / "bundle",
            name="tiny",
            training={},
            catalogue=[CatalogueVessel("rhib", CATALOGUE[0].box)],
            models={"prior": tmp_path / "prior.onnx"},
        )


def test_a_stage_that_misses_a_key_learns_where(folder):
    bundle = load_bundle(folder)
    with pytest.raises(
        BundleError, match=r"expected parameters\.best\.scale in manifest\.toml, got temperature, edges"
    ):
        bundle.parameters["best"]["scale"]
    with pytest.raises(BundleError, match=r"expected models\.heading in manifest\.toml, got prior"):
        bundle.models["heading"]
    assert bundle.parameters.get("paper") is None


def with_parameter(table, key, value):
    bundle = untrained_bundle()
    return replace(bundle, parameters={**PARAMETERS, table: {**PARAMETERS[table], key: value}})


def test_a_bundle_whose_parts_belong_together_fits():
    check_fit(untrained_bundle())
    check_fit(with_parameter("best", "note", "free"))


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("common", "spd2_radius", 0.0),
        ("common", "prior_temperature", float("nan")),
        ("common", "unknown_above", 1.5),
        ("paper", "heading_std", -1.0),
        ("paper", "part_keypoints", 0),
        ("paper", "part_sharpness", float("inf")),
        ("paper", "empty_below", "low"),
        ("best", "looks", "2"),
        ("best", "looks", 0),
        ("best", "looks", True),
        ("best", "heading_std_scale", 0),
        ("best", "bow_weights", [1.0]),
        ("best", "fusion_weights", [0.5, 0.5]),
        ("best", "fusion_weights", 0.5),
        ("best", "fusion_weights", [0.4, 0.3, 0.2, "0.1"]),
    ],
)
def test_a_parameter_that_the_stages_cannot_use_is_refused_in_one_sentence(table, key, value):
    with pytest.raises(BundleError, match=rf"^expected another value of parameters\.{table}\.{key}\b.*, got "):
        check_fit(with_parameter(table, key, value))


def test_a_parameter_that_is_missing_is_refused_in_one_sentence():
    best = {key: value for key, value in PARAMETERS["best"].items() if key != "looks"}
    with pytest.raises(
        BundleError, match=r"^expected the key parameters\.best\.looks in manifest\.toml, got none$"
    ):
        check_fit(replace(untrained_bundle(), parameters={**PARAMETERS, "best": best}))
    with pytest.raises(BundleError, match=r"^expected the key parameters\.common in manifest\.toml, got none$"):
        check_fit(replace(untrained_bundle(), parameters={}))


def test_a_catalogue_of_another_length_than_the_networks_classes_is_refused_in_one_sentence():
    bundle = untrained_bundle()
    with pytest.raises(
        BundleError, match=r"to tell \d classes, for the 2 vessels of the catalogue, got a network"
    ):
        check_fit(replace(bundle, catalogue=bundle.catalogue[:2]))
    networks = {**bundle.models, "spd2_full_top": bundle.models["spd2"]}
    expected = rf"^expected spd2_full_top to tell {CLASSES - 1} classes, .*, got a network for {CLASSES}$"
    with pytest.raises(BundleError, match=expected):
        check_fit(replace(bundle, models=networks))


def test_a_bundle_of_before_there_were_reasons_fits():
    assert "reasons" not in PARAMETERS
    check_fit(untrained_bundle())
    check_fit(with_reasons({"few_points": 40}))


@pytest.mark.parametrize(
    ("key", "value"),
    [("few_points", -1), ("few_points", 2.5), ("end_on_deg", 91.0), ("occluded_above", 1.5), ("bow_below", "0.9")],
)
def test_a_threshold_of_a_reason_that_cannot_be_is_refused(key, value):
    with pytest.raises(BundleError, match=rf"^expected another value of parameters\.reasons\.{key}\b.*, got "):
        check_fit(with_reasons({key: value}))


def with_reasons(table):
    return replace(untrained_bundle(), parameters={**PARAMETERS, "reasons": table})
