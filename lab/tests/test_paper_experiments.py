"""Heading comparison, Experiment 2 and the ablation on a few clusters, with networks whose answers are known."""

import json

import numpy as np
import pytest
from thin_grid import thin_grid
from untrained import PARAMETERS, SPD2, _constant_onnx, write_untrained

from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.stages import heading
from shipshape.stages.keypoints import KeypointParams
from shipshape.types import Contact, ImageMethod, Options, Preset
from shipshape_lab.experiments import ablation, experiment_2, heading_peers
from shipshape_lab.experiments.pages import ablation as ablation_page
from shipshape_lab.experiments.pages import experiment_2 as experiment_2_page
from shipshape_lab.experiments.pages import heading_peers as heading_page
from shipshape_lab.simulator.clusters import load, save


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    save(folder / "P.npz", thin_grid())
    return folder


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    write_untrained(folder)
    return folder


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """Classifiers that call everything by the second name of the catalogue."""
    folder = tmp_path_factory.mktemp("complete")
    for name in ("raw", *ImageMethod):
        network = _constant_onnx(SPD2, {"logits": np.array([0.0, 3.0, 0.0, 0.0, 0.0])})
        (folder / f"complete_{name}.onnx").write_bytes(network)
    return folder


def run(experiment, data, out, models, *more):
    folders = ["--data", str(data), "--out", str(out), "--bundle", str(models), "--figures", str(out)]
    experiment.main([*folders, *more])
    return json.loads((out / f"{experiment.__name__.rsplit('.', 1)[1]}.json").read_text())


def test_headings_are_those_of_the_service_and_refusals_count_as_wrong(data, models, tmp_path, monkeypatch):
    left = run(heading_peers, data, tmp_path, models)
    clusters = load(data / "P.npz")
    with np.load(tmp_path / "heading_peers_P.npz") as kept:
        found = dict(zip(heading_peers.METHODS, kept["headings"], strict=True))
    contact = Contact(clusters.cluster(1))
    pipeline = Pipeline(load_bundle(models))
    assert found["best"][1] == np.float32(pipeline.run(contact).heading)
    assert found["paper"][1] == np.float32(pipeline.run(contact, Options(Preset.PAPER)).heading)
    box = clusters.vessels[0].box
    told = heading.by_area_projection(contact.points_level, box)
    assert found["area_projection_told"][1] == np.float32(told)
    assert all(np.isnan(headings[3]) and np.isfinite(headings[:3]).all() for headings in found.values())
    assert max(value for key, value in left["numbers"].items() if key.endswith("within_10deg")) <= 0.75
    assert "| rectangle of least area |" in heading_page.section(left["numbers"], left["about"])
    monkeypatch.setattr(heading_peers, "headings", lambda *_: pytest.fail("computed again"))
    assert run(heading_peers, data, tmp_path, models)["numbers"] == left["numbers"]


def test_a_right_angle_off_is_swapped_and_a_half_turn_off_is_flipped(data):
    clusters = load(data / "P.npz")
    found = np.tile(clusters.heading, (len(heading_peers.METHODS), 1))
    found[heading_peers.METHODS.index("l_shape"), 0] += np.pi / 2
    found[heading_peers.METHODS.index("best"), 0] += np.pi
    numbers = heading_peers.of_headings("P", found, clusters)
    assert numbers["P.heading.l_shape.swapped_90"] == 0.25
    assert numbers["P.heading.best.swapped_90"] == 0.0
    assert numbers["P.heading.best.flipped"] == 0.25
    assert numbers["P.heading.best.median_deg"] == pytest.approx(0.0, abs=1e-6)
    assert numbers["P.heading.l_shape.within_5deg.110m"] == pytest.approx(2 / 3)


def test_experiment_2_reads_each_image_with_both_classifiers(data, models, complete, tmp_path, monkeypatch):
    left = run(experiment_2, data, tmp_path, models, "--complete", str(complete))
    numbers = left["numbers"]
    for system in experiment_2.SYSTEMS:
        assert numbers[f"P.accuracy_restored.{system}.overall"] == 0.5  # always the rhib
        assert numbers[f"P.accuracy_complete.{system}.overall"] == 0.25  # always the pilot boat
    assert numbers["P.accuracy_complete.z_side.110m"] == pytest.approx(1 / 3, abs=1e-5)
    assert "| `full_side` | *paper* | *(97.06)* |" in experiment_2_page.section(numbers, left["about"])
    monkeypatch.setattr(experiment_2, "answer", lambda *_: pytest.fail("computed again"))
    assert run(experiment_2, data, tmp_path, models, "--complete", str(complete))["numbers"] == numbers


def test_experiment_2_says_which_network_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"expected .*complete_raw\.onnx, found none"):
        experiment_2.load_complete(tmp_path)


def test_the_served_cell_of_the_ablation_is_what_the_pipeline_answers(data, models):
    clusters, pipeline = load(data / "P.npz"), Pipeline(load_bundle(models))
    served = ablation.CELLS.index(KeypointParams())
    answers = ablation.answer(pipeline, clusters.cluster(1))
    assert answers.shape == (2, 64)
    said = pipeline.run(Contact(clusters.cluster(1)), Options(Preset.PAPER, ablation.METHOD))
    assert pipeline.bundle.catalogue[answers[1, served]].name == said.vessel


def test_the_ablation_hands_each_cell_its_own_keypoints(monkeypatch):
    seen = []
    monkeypatch.setattr(ablation.spd2, "describe", lambda points, chosen, radius: seen.append(chosen))
    monkeypatch.setattr(
        ablation.classification, "mean_confidence", lambda images, model: np.eye(6)[5] + np.eye(6)[2]
    )
    # Two dense balls 0.8 m apart and a lone point far off: a d_min above 0.8 m must skip the second ball.
    rng = np.random.default_rng(1)
    balls = [rng.normal((shift, 0.0, 0.0), 0.01, (40, 3)) for shift in (0.0, 0.8, 9.0)]
    points = np.concatenate([balls[0], balls[1][:30], balls[2][:1]]).astype(np.float32)
    found = ablation.by_cell(points, None, PARAMETERS["common"]["spd2_radius"], 5)
    assert (found == 2).all()
    by_params = dict(zip(ablation.CELLS, seen, strict=True))
    assert by_params[KeypointParams(0.3, 0.5)][1, 0] == pytest.approx(0.8, abs=0.1)
    assert by_params[KeypointParams(0.3, 1.0)][1, 0] == pytest.approx(9.0, abs=0.1)


def test_the_ablation_names_the_best_cell():
    right = np.zeros((2, 64, 10), np.bool_)
    right[:, :, :4] = True
    right[1, ablation.CELLS.index(KeypointParams(0.7, 0.4)), :6] = True
    numbers = ablation.of_right(right)
    assert numbers["validation.ablation.full_side.r_70cm_d_40cm"] == 0.6
    assert (
        numbers["validation.ablation.full_side.best_r_cm"],
        numbers["validation.ablation.full_side.best_d_cm"],
    ) == (70, 40)
    assert numbers["validation.ablation.full_side.lead"] == pytest.approx(0.2)
    assert numbers["validation.ablation.full_side.lead_error"] == pytest.approx(np.sqrt(0.2 * 0.8 / 10))
    page = ablation_page.section(numbers, {})
    assert "40.00 % at 0.5 and 0.5; best 60.00 % at r = 0.7, d_min = 0.4; worst 40.00 %" in page
