"""PCN and SnowflakeNet are those of their papers, learn, and answer in the frame they are asked in."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

import torch

from shipshape.types import Pose, ReferenceBox
from shipshape_lab import metrics
from shipshape_lab.completion import layers, load, plans, train, validate
from shipshape_lab.completion.clouds import from_unit, resampled, to_unit
from shipshape_lab.completion.pcn import Pcn, PcnSize
from shipshape_lab.completion.snowflakenet import SnowflakeNet, SnowflakeSize
from shipshape_lab.simulator import datasets
from shipshape_lab.simulator.clusters import collect, save

TINY = {
    "pcn": PcnSize(16, 2, (8, 16, 16, 32), 16),
    "snowflakenet": SnowflakeSize(32, 16, 32, (1, 2), (16, 8), 4, 8),
}
POSE = Pose(0.7, (40.0, -12.0, -3.0), ReferenceBox(12.0, 4.0, 5.0))


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Twelve clusters of a few hulls, once to train on and once to validate on."""
    folder = tmp_path_factory.mktemp("data")
    job = datasets.Job("P", 12, 3)
    clusters = collect([datasets.grid_cluster(job, 8 * 360 + 30 * i) for i in range(12)], job.catalogue, job.seed)
    pairs = sorted(set(zip(clusters.label.tolist(), clusters.hull_seed.tolist(), strict=True)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(datasets, "SURFACE_POINTS", 500)
        hulls = [(job.catalogue.classes[label], seed) for label, seed in pairs]
        surfaces = datasets.make_surfaces(hulls, progress=False)
    for name in ("train", "validation"):
        save(folder / f"{name}.npz", clusters)
        save(folder / f"{name}_surfaces.npz", surfaces)
    return folder


@pytest.fixture
def tiny_plans(monkeypatch):
    for model, size in TINY.items():
        plan = replace(plans.PLANS[model, "reduced"], size=size, seen=32, target=64, clusters=8, rounds=2, batch=4)
        monkeypatch.setitem(plans.PLANS, (model, "reduced"), plan)


def net_of(model):
    torch.manual_seed(0)
    return plans.Plan(TINY[model], 32, 64, 8, 2, 4).net()


@pytest.mark.parametrize(
    ("net", "millions", "points"),
    [(Pcn, 6.86, [1024, 16_384]), (SnowflakeNet, 19.32, [256, 512, 2048, 16_384])],
)
def test_the_full_size_is_the_published_one(net, millions, points):
    made = net().eval()
    assert sum(weights.numel() for weights in made.parameters()) / 1e6 == pytest.approx(millions, abs=0.01)
    with torch.inference_mode():
        assert [cloud.shape[1] for cloud in made(torch.rand(1, 2048, 3))] == points


def test_a_joined_layer_is_one_of_the_concatenation():
    net = net_of("pcn")
    code, grid, centre = torch.rand(2, 1, 1, 32), torch.rand(1, 1, 4, 2), torch.rand(2, 16, 1, 3)
    together = torch.cat([code.expand(2, 16, 4, 32), grid.expand(2, 16, 4, 2), centre.expand(2, 16, 4, 3)], -1)
    torch.testing.assert_close(net.fold_in(code, grid, centre), net.fold_in.linear(together))


@pytest.mark.parametrize("model", plans.MODELS)
def test_the_order_of_the_points_does_not_matter(model):
    net, cloud = net_of(model).eval(), torch.rand(1, 32, 3)
    shuffled = torch.cat([cloud[:, :1], cloud[:, 1 + torch.randperm(31)]], 1)  # farthest points start at the first
    with torch.inference_mode():
        torch.testing.assert_close(net(cloud)[-1], net(shuffled)[-1], atol=1e-5, rtol=0)


def test_chamfer_is_that_of_the_metrics_and_pulls_points_together():
    rng = np.random.default_rng(0)
    a, b = (rng.random((1, n, 3)).astype(np.float32) for n in (40, 70))
    expected = metrics.chamfer_l1(metrics.CompleteSurface(b[0], 1.0).nearest(a[0]))
    cloud = torch.from_numpy(a).requires_grad_()
    loss = layers.chamfer_l1(cloud, torch.from_numpy(b))
    assert loss.item() == pytest.approx(expected, rel=1e-4)
    loss.backward()
    assert layers.chamfer_l1(cloud.detach() - 0.5 * cloud.grad, torch.from_numpy(b)).item() < loss.item()


def test_neighbours_are_those_of_a_search_tree():
    a, b = (np.random.default_rng(seed).random((2, 50, 3)).astype(np.float32) for seed in (1, 2))
    found = layers.neighbours(torch.from_numpy(a), torch.from_numpy(b), 5).numpy()
    for row in range(2):
        assert_allclose(found[row], cKDTree(b[row]).query(a[row], 5)[1])


def test_farthest_points_cover_a_line_by_halves():
    line = torch.tensor([0.0, 1.0, 2.0, 3.0, 4.0])[None, :, None] * torch.ones(3)
    assert layers.farthest(line, 3).tolist() == [[0, 4, 2]]


def test_every_point_comes_before_one_comes_again():
    points = np.arange(15, dtype=np.float32).reshape(5, 3)
    drawn = resampled(points, 13, np.random.default_rng(0))
    counts = np.unique(drawn[:, 0], return_counts=True)[1]
    assert len(drawn) == 13
    assert sorted(counts.tolist()) == [2, 2, 3, 3, 3]


def test_units_are_lengths_of_the_vessel_and_come_back():
    bow = POSE.to_level(np.array([[6.0, 0.0, 0.0]], np.float32))
    assert_allclose(to_unit(bow, POSE), [[0.5, 0.0, 0.0]], atol=1e-6)
    assert_allclose(from_unit(to_unit(bow, POSE), POSE), bow, atol=1e-5)


@pytest.mark.parametrize("model", plans.MODELS)
def test_both_learn_one_shape(model):
    net, batch = net_of(model).train(), {"cloud": torch.rand(4, 32, 3) - 0.5, "target": torch.rand(4, 64, 3) - 0.5}
    optimizer, losses = torch.optim.Adam(net.parameters(), lr=2e-3), []
    for _ in range(20):
        loss = plans.loss_of(net, batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.8 * losses[0]


@pytest.mark.parametrize("model", plans.MODELS)
def test_what_is_trained_is_what_is_loaded(model, data, tiny_plans, tmp_path):
    train.main(["--model", model, "--data", str(data), "--out", str(tmp_path)])
    (completer,) = load.load_completers(tmp_path)
    points = POSE.to_level(np.random.default_rng(0).random((20, 3)).astype(np.float32))
    cloud = completer.complete(points, POSE)
    assert completer.name == model
    assert cloud.dtype == np.float32
    assert_allclose(cloud, completer.complete(points, POSE))
    both = len(completer.net(torch.rand(1, 32, 3))[-1][0]) + len(points) * completer.with_measured
    assert cloud.shape == (both, 3)
    about = load.training_of(tmp_path / model)
    plan = plans.PLANS[model, about.schedule]
    assert (about.schedule, about.clusters) == ("reduced", plan.rounds * plan.clusters)
    assert about.last_gain < 1.0


def test_a_turned_vessel_is_completed_alike():
    completer = load.Completer("pcn", net_of("pcn").eval(), 32, with_measured=False)
    vessel = (np.random.default_rng(0).random((20, 3)) * [12.0, 4.0, 5.0]).astype(np.float32)
    other = Pose(-2.0, (-30.0, 5.0, -1.0), POSE.size)
    here, there = (pose.to_vessel(completer.complete(pose.to_level(vessel), pose)) for pose in (POSE, other))
    assert_allclose(here, there, atol=1e-4)


def test_the_better_choice_is_made_on_validation(data):
    examples = train.Examples.read(data, "validation")
    completer = load.Completer("pcn", net_of("pcn").eval(), 32, with_measured=False)
    helps, scores = validate.measured_helps(completer, validate.drawn(examples, 12))
    assert helps == (scores["with_measured"]["cd_l1"] < scores["drawn"]["cd_l1"])
    assert helps  # an untrained network draws nothing like a vessel
    assert scores["with_measured"]["points"] > scores["drawn"]["points"] == 64
