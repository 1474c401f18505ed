import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from thin_grid import thin_grid
from untrained import write_untrained

from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, ImageMethod, Options, Pose, Preset, ReferenceBox
from shipshape_lab.experiments import evaluate, numbers, predictions, report, restoration
from shipshape_lab.experiments.predictions import Answers, Truth
from shipshape_lab.experiments.systems import BEST, IMAGE_METHODS, run_systems
from shipshape_lab.simulator import datasets
from shipshape_lab.simulator.clusters import save
from shipshape_lab.training.examples import Examples


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    clusters = thin_grid()
    save(folder / "P.npz", clusters)
    pairs = sorted(set(zip(clusters.label.tolist(), clusters.hull_seed.tolist(), strict=True)))
    hulls = [(str(clusters.classes[label]), seed) for label, seed in pairs]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(datasets, "SURFACE_POINTS", 6_000)
        save(folder / "P_surfaces.npz", datasets.make_surfaces(hulls, progress=False))
    return folder


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    write_untrained(folder)
    return folder


@pytest.fixture(scope="module")
def results(data, models, tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    run_both(data, models, folder)
    return folder


def run_both(data, models, out):
    arguments = ["--set", "P", "--data", str(data), "--bundle", str(models), "--out", str(out)]
    evaluate.main(arguments)
    restoration.main([*arguments, "--every", "1"])


def test_shared_stages_give_what_the_pipeline_gives(data, models):
    pipeline, examples = Pipeline(load_bundle(models)), Examples.read(data, "P")
    contact = Contact(examples.clusters.cluster(1))
    runs = run_systems(pipeline, contact)
    options = {str(method): Options(Preset.PAPER, method) for method in ImageMethod}
    for name, option in {BEST: Options(Preset.BEST), **options}.items():
        ours, alone = pipeline.finish(runs[name].work, runs[name].stage_ms), pipeline.run(contact, option)
        assert ours.probabilities == alone.probabilities
        assert (ours.heading, ours.box, ours.image_method) == (alone.heading, alone.box, alone.image_method)
        assert_allclose(ours.restored.points_level, alone.restored.points_level)
        assert list(ours.stage_ms) == list(alone.stage_ms)


def test_every_cluster_is_answered_or_refused(results):
    truth, answers = predictions.load(results / "P.npz")
    assert answers.done.all()
    assert truth.label.tolist() == [0, 0, 1, 0]
    assert answers.system.tolist() == [BEST, "raw_spd2", *IMAGE_METHODS]
    for system in answers.system:
        assert answers.of(system).vessel.tolist() == [0, 0, 0, predictions.REFUSED]
        assert answers.of(system).decision.tolist() == [0, 0, 0, predictions.REFUSED]
    assert np.isnan(answers.of("raw_spd2").heading).all()
    assert np.isfinite(answers.of(BEST).heading[:3]).all()
    assert np.isfinite(answers.of(BEST).heading_std[:3]).all()


def test_a_finished_run_is_not_done_again(data, models, results, monkeypatch):
    monkeypatch.setattr(evaluate, "run_systems", lambda *_: pytest.fail("computed again"))
    monkeypatch.setattr(restoration, "run_systems", lambda *_: pytest.fail("computed again"))
    run_both(data, models, results)


def test_a_stopped_run_goes_on_where_it_was(tmp_path, results):
    truth, answers = predictions.load(results / "P.npz")
    answers.done[:, 1:] = False
    predictions.save(tmp_path / "P.npz", truth, answers)
    keys = dict(zip(answers.system.tolist(), answers.key.tolist(), strict=True)) | {"z_top": "another bundle"}
    found = predictions.resume(tmp_path / "P.npz", truth, Answers.empty({"pointnet": "new", **keys}, 4, 6))
    assert found.done[:, 1:].sum() == 0
    assert dict(zip(found.system.tolist(), found.done[:, 0].tolist(), strict=True)) == {
        name: name not in ("pointnet", "z_top") for name in found.system.tolist()
    }
    assert found.of(BEST).vessel[0] == answers.of(BEST).vessel[0]
    other = Truth(**{**vars(truth), "key": np.array(["another set"])})
    assert not predictions.resume(tmp_path / "P.npz", other, Answers.empty(keys, 4, 6)).done.any()


class Always:
    """A peer that calls everything unknown, and counts how often it was asked."""

    name = "pointnet"

    def __init__(self):
        self.asked = 0

    def classify(self, contact):
        self.asked += 1
        return np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.9], np.float32)


def test_a_peer_that_comes_later_is_asked_alone_and_not_about_what_is_refused(data, models, results, monkeypatch):
    examples, peer = Examples.read(data, "P"), Always()
    panel = evaluate.Panel(Pipeline(load_bundle(models)), IMAGE_METHODS, [peer])
    truth, _ = predictions.load(results / "P.npz")
    answers = predictions.resume(results / "P.npz", truth, Answers.empty(panel.keys(results), 4, 6))
    monkeypatch.setattr(evaluate, "run_systems", lambda *_: pytest.fail("computed again"))
    evaluate.evaluate(examples, panel, answers, truth, results / "with_peer.npz")
    assert peer.asked == 3
    said = predictions.load(results / "with_peer.npz")[1].of("pointnet")
    assert said.vessel.tolist() == [0, 0, 0, predictions.REFUSED]
    assert said.decision.tolist() == [5, 5, 5, predictions.REFUSED]


def test_refused_clusters_count_as_wrong(results):
    found = numbers.of_answers("P", *predictions.load(results / "P.npz"), ["rhib", "pilot_boat"])
    assert (found["P.clusters"], found["P.refused"]) == (4, 1)
    assert found["P.accuracy.best.overall"] == 2 / 4
    assert found["P.accuracy.best.pilot_boat"] == 0.0
    assert found["P.accuracy.best.110m"] == 1 / 3
    assert found["P.heading.paper.within_10deg"] <= 3 / 4


def test_slices_are_those_of_the_paper_grid():
    masks = numbers.slices(np.array([70.0, 80.0, 110.0, 30.0]), np.array([15.0, 15.5, 165.0, 180.0]))
    assert masks["beyond_70m"].tolist() == [False, True, True, False]
    assert masks["bow_on"].tolist() == [True, False, False, False]
    assert masks["stern_on"].tolist() == [False, False, True, True]
    assert masks["aspect_150_180"].tolist() == [False, False, True, True]
    assert masks["110m"].tolist() == [False, False, True, False]
    assert "40m" not in masks


def test_mirroring_about_the_true_pose_completes_a_symmetric_cloud():
    pose = Pose(0.7, (40.0, 5.0, -3.0), ReferenceBox(10.0, 4.0, 3.0))
    port = np.array([[1.0, 2.0, 0.5], [-3.0, 1.5, 1.0]], np.float32)
    cloud = pose.to_vessel(restoration.mirrored(pose.to_level(port), pose))
    assert_allclose(cloud, np.concatenate([port, port * [1, -1, 1]]), atol=1e-5)


def test_restoration_is_scored_against_the_complete_surface(results):
    with np.load(results / "restoration_p.npz") as arrays:
        scores = arrays["scores"]
    of = {name: scores[:, i] for i, name in enumerate(restoration.CLOUDS)}
    assert np.isnan(scores[3]).all()
    assert (of["surface"][:3, 0] < of["raw"][:3, 0]).all()
    assert (of["mirrored_true_pose"][:3, 0] < of["raw"][:3, 0]).all()
    assert (of["mirrored"][:3, 3] == 2 * of["raw"][:3, 3]).all()
    assert (of["surface"][:3, 3] == restoration.REFERENCE_POINTS).all()


def test_the_report_is_the_same_each_time_and_says_what_was_not_measured(results, tmp_path):
    pages = []
    for turn in ("first", "second"):
        report.main(["--results", str(results), "--out", str(tmp_path / turn)])
        pages.append({file.name: file.read_bytes() for file in (tmp_path / turn).rglob("*.*")})
    assert pages[0] == pages[1]
    found, page = json.loads(pages[0]["results.json"]), pages[0]["results.md"].decode()
    assert found["commit"] == "0" * 40
    assert found["P.accuracy.best.overall"] == 0.5
    assert found["P.cd_l1.raw"] > found["P.cd_l1.surface"]
    assert "| at least 99.80 % | 50.00 % | **NOT reached** |" in page
    assert "| at most 2.50 ms | - | not measured |" in page
    assert "![accuracy by distance and by aspect](figures/accuracy.png)" in page
    assert "## Not measured" in page
    assert "- Milliseconds: `pipeline_ms`" in page
    assert "P: 1 of 4 clusters are refused" in page


@pytest.fixture
def copied(results, tmp_path):
    for file in results.glob("*.json"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path


def test_the_report_refuses_results_of_two_bundles(copied):
    outcome = json.loads((copied / "restoration_p.json").read_text())
    outcome["about"]["bundle_digest"] = "f" * 64
    (copied / "restoration_p.json").write_text(json.dumps(outcome))
    with pytest.raises(ValueError, match=r"restoration_p\.json of bundle"):
        report.collect(copied)


def test_the_report_refuses_two_values_of_one_number(copied):
    (copied / "other.json").write_text(json.dumps({"about": {}, "numbers": {"P.clusters": 5, "X.new": 1.5}}))
    with pytest.raises(ValueError, match=r"one value of P\.clusters, got 4 and 5 in other\.json"):
        report.merged(report.collect(copied))
    (copied / "other.json").write_text(json.dumps({"about": {}, "numbers": {"P.clusters": 4, "X.new": 1.5}}))
    assert report.merged(report.collect(copied))["X.new"] == 1.5


def test_the_report_needs_the_paper_grid(tmp_path):
    with pytest.raises(ValueError, match=r"expected recognition_p\.json"):
        report.collect(tmp_path)


@pytest.fixture(scope="module")
def benchmark():
    path = Path(__file__).parents[2] / "benchmarks/pipeline.py"
    spec = importlib.util.spec_from_file_location("benchmark_pipeline", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_benchmark_times_every_stage_of_clusters_of_exactly_that_size(benchmark, models):
    points = benchmark.cluster_of(100, 37, np.random.default_rng(1))
    assert points.shape == (100, 3)
    pipeline = Pipeline(load_bundle(models))
    measured = benchmark.summary(benchmark.measure(pipeline, [Contact(points)], runs=3))
    assert list(measured["stages"]) == [stage.name for stage in pipeline.stages]
    medians = [times["median"] for times in measured["stages"].values()]
    assert 0 < max(medians) < measured["total"]["median"]
    found = numbers.of_pipeline_ms({"100": measured})
    assert found["pipeline_ms.best.100"] == measured["total"]["median"]
    assert "keypoints" in benchmark.table({"100": measured})
