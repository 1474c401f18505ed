import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from untrained import write_untrained

from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, ImageMethod, Options, Pose, Preset, ReferenceBox
from shipshape_lab.experiments import evaluate_p, numbers, predictions, report, restoration_p
from shipshape_lab.experiments.predictions import Answers, Truth
from shipshape_lab.experiments.systems import BEST, SYSTEMS, run_systems
from shipshape_lab.experiments.targets import TARGETS
from shipshape_lab.simulator import datasets
from shipshape_lab.simulator.clusters import collect, save
from shipshape_lab.training.examples import Examples

CELLS = (8 * 360 + 40, 4 * 360 + 200, 3240 + 8 * 360)  # a far and a middling rhib, a far pilot boat bow-on


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Three cells of the paper grid, a fourth with too few points to be answered."""
    folder = tmp_path_factory.mktemp("data")
    job = datasets.Job("P", len(CELLS), 3)
    scans = [datasets.grid_cluster(job, cell) for cell in CELLS]
    thin, sensor = scans[0]
    scans.append((thin.__class__(**{**vars(thin), "points_level": thin.points_level[:4]}), sensor))
    clusters = collect(scans, job.catalogue, job.seed)
    save(folder / "P.npz", clusters)
    pairs = sorted(set(zip(clusters.label.tolist(), clusters.hull_seed.tolist(), strict=True)))
    hulls = [(job.catalogue.classes[label], seed) for label, seed in pairs]
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
    arguments = ["--data", str(data), "--bundle", str(models), "--out", str(folder)]
    evaluate_p.main(arguments)
    restoration_p.main([*arguments, "--every", "1"])
    return folder


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
    assert (answers.vessel[:, :3] == 0).all()
    assert (answers.vessel[:, 3] == predictions.REFUSED).all()
    assert np.isnan(answers.heading[SYSTEMS.index("raw_spd2")]).all()
    assert np.isfinite(answers.heading[SYSTEMS.index(BEST), :3]).all()


def test_a_finished_run_is_not_done_again(data, models, results, monkeypatch):
    monkeypatch.setattr(evaluate_p, "run_systems", lambda *_: pytest.fail("computed again"))
    monkeypatch.setattr(restoration_p, "run_systems", lambda *_: pytest.fail("computed again"))
    arguments = ["--data", str(data), "--bundle", str(models), "--out", str(results)]
    evaluate_p.main(arguments)
    restoration_p.main([*arguments, "--every", "1"])


def test_a_stopped_run_goes_on_where_it_was(tmp_path, results):
    truth, answers = predictions.load(results / "P.npz")
    answers.done[1:] = False
    predictions.save(tmp_path / "P.npz", truth, answers)
    blank = Answers.empty(len(SYSTEMS), 4, 9)
    assert predictions.resume(tmp_path / "P.npz", truth, blank).done.tolist() == [True, False, False, False]
    other = Truth(**{**vars(truth), "key": np.array(["another bundle"])})
    assert predictions.resume(tmp_path / "P.npz", other, blank) is blank


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
    cloud = pose.to_vessel(restoration_p.mirrored(pose.to_level(port), pose))
    assert_allclose(cloud, np.concatenate([port, port * [1, -1, 1]]), atol=1e-5)


def test_restoration_is_scored_against_the_complete_surface(results):
    with np.load(results / "restoration.npz") as arrays:
        scores = arrays["scores"]
    of = {name: scores[:, i] for i, name in enumerate(restoration_p.CLOUDS)}
    assert np.isnan(scores[3]).all()
    assert (of["surface"][:3, 0] < of["raw"][:3, 0]).all()
    assert (of["mirrored_true_pose"][:3, 0] < of["raw"][:3, 0]).all()
    assert (of["mirrored"][:3, 3] == 2 * of["raw"][:3, 3]).all()
    assert (of["surface"][:3, 3] == restoration_p.REFERENCE_POINTS).all()


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
    assert "| at least 98 % | 50.00 % | **NOT reached** |" in page
    assert "| at most 5 ms | - | not measured |" in page
    assert "![accuracy by distance and by aspect](figures/accuracy.png)" in page
    assert "gallery.png" not in page


def test_the_report_refuses_results_of_two_bundles(results, tmp_path):
    for file in results.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    about = json.loads((tmp_path / "restoration.json").read_text())
    (tmp_path / "restoration.json").write_text(json.dumps({**about, "bundle_digest": "f" * 64}))
    with pytest.raises(ValueError, match=r"restoration\.json of bundle"):
        report.collect(tmp_path)


def test_the_report_refuses_an_unfinished_run(results, tmp_path):
    truth, answers = predictions.load(results / "P.npz")
    answers.done[2] = False
    predictions.save(tmp_path / "P.npz", truth, answers)
    (tmp_path / "P.json").write_bytes((results / "P.json").read_bytes())
    with pytest.raises(ValueError, match="expected all 4 clusters of P, got 3"):
        report.collect(tmp_path)


def test_targets_compare_the_right_way_round():
    good = {
        "P.heading.best.within_5deg": 0.95,
        "P.bow_stern.best": 0.98,
        "P.accuracy.best.overall": 0.98,
        "P.accuracy.best.beyond_70m": 0.97,
        "P.accuracy.best.bow_on": 0.97,
        "P.accuracy.best.stern_on": 0.97,
        "P.cd_l1.best": 8.0,
        "P.cd_l1.mirrored": 10.0,
        "P.fscore.best": 0.6,
        "P.fscore.mirrored": 0.5,
        "pipeline_ms.best.1000": 5.0,
    }
    assert {target.verdict(good)[1] for target in TARGETS} == {"reached"}
    bad = {
        key: 2 * value if key in ("P.cd_l1.best", "pipeline_ms.best.1000") else 0.9 * value
        for key, value in good.items()
    }
    bad["P.fscore.best"] = 0.1
    assert {target.verdict(bad)[1] for target in TARGETS} == {"**NOT reached**"}


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
    found = numbers.of_pipeline_ms({"points": {"100": measured}})
    assert found["pipeline_ms.best.100"] == measured["total"]["median"]
    assert "keypoints" in benchmark.table({"100": measured})
