"""The peers: their geometry against other ways to compute it, that they learn, and come back as saved."""

from dataclasses import fields

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

import torch
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from untrained import write_untrained

from shipshape import sight
from shipshape.softmax import softmax
from shipshape.types import Contact
from shipshape_lab.peers import mirrored, pointnet2, train
from shipshape_lab.peers.clouds import MOST_POINTS, Packed, network_inputs
from shipshape_lab.peers.load import load_peers
from shipshape_lab.peers.pointnet import PointNet
from shipshape_lab.peers.pointnet2 import PointNet2
from shipshape_lab.peers.validate import fitted_temperature
from shipshape_lab.simulator import clusters, datasets
from shipshape_lab.simulator.catalogue import DEFAULT
from shipshape_lab.simulator.clusters import ClusterSet
from shipshape_lab.simulator.datasets import Job

COUNTS = (40, 25, 12)
ONCE_A_SET = {"classes", "seed", "catalogue", "boxes"}


def contact(n=60, length=14.0, seed=3):
    rng = np.random.default_rng(seed)
    points = rng.uniform([60.0, 5.0, -3.0], [60.0 + length, 9.0, 1.0], (n, 3)).astype(np.float32)
    return Contact(points, sensor_height=4.0)


@pytest.fixture
def padded():
    """Three clouds of different sizes, the unused places full of points that would spoil any result."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-10, 10, (len(COUNTS), max(COUNTS), 3)).astype(np.float32)
    return torch.from_numpy(points), torch.tensor(COUNTS)


def test_inputs_are_the_points_along_the_line_of_sight():
    seen = contact()
    inputs = network_inputs(seen, np.random.default_rng(1))
    wanted = sight.to_sight(seen.points_level, sight.sight_frame(seen))
    found = inputs["points"][: inputs["count"]]
    assert inputs["count"] == len(wanted)
    np.testing.assert_array_equal(found[np.lexsort(found.T)], wanted[np.lexsort(wanted.T)])
    np.testing.assert_allclose(inputs["features"], [np.log(67.3), np.log(60), 1.0], rtol=0.01)


def test_of_a_large_cluster_that_many_points_are_drawn_and_none_twice():
    inputs = network_inputs(contact(3 * MOST_POINTS), np.random.default_rng(1))
    assert inputs["count"] == MOST_POINTS
    assert len(np.unique(inputs["points"], axis=0)) == MOST_POINTS
    assert inputs["features"][1] == pytest.approx(np.log(3 * MOST_POINTS))


def test_farthest_points_are_those_of_the_greedy_search(padded):
    points, count = padded
    chosen = pointnet2.farthest_points(points, count, 10).numpy()
    for cloud, n, found in zip(points.numpy(), COUNTS, chosen, strict=True):
        apart = cdist(cloud[:n], cloud[:n])
        wanted = [0]
        while len(wanted) < 10:
            wanted.append(int(apart[wanted].min(axis=0).argmax()))
        np.testing.assert_array_equal(found, wanted)


def test_farthest_points_take_each_point_before_any_comes_again(padded):
    points, count = padded
    chosen = pointnet2.farthest_points(points, count, 30).numpy()
    for n, found in zip(COUNTS, chosen, strict=True):
        assert len(set(found[:n])) == min(n, 30)
        assert found.max() < n


def test_a_ball_holds_the_first_points_within_its_radius(padded):
    points, count = padded
    centres = points[:, :5]
    members = pointnet2.in_ball(points, count, centres, 6.0, 4).numpy()
    for cloud, n, found in zip(points.numpy(), COUNTS, members, strict=True):
        for centre, row in zip(cloud[:5], found, strict=True):
            wanted = sorted(cKDTree(cloud[:n]).query_ball_point(centre, 6.0))[:4]
            np.testing.assert_array_equal(row, wanted + [wanted[0]] * (4 - len(wanted)))


def test_the_largest_of_a_packed_set_is_that_of_its_own_rows(padded):
    points, count = padded
    largest = Packed.of(points, count).largest().numpy()
    for cloud, n, found in zip(points.numpy(), COUNTS, largest, strict=True):
        np.testing.assert_array_equal(found, cloud[:n].max(axis=0))


@pytest.mark.parametrize("network", [PointNet, PointNet2])
def test_neither_padding_nor_the_rest_of_the_batch_changes_an_answer(network, padded):
    points, count = padded
    torch.manual_seed(0)
    net, features = network(6).eval(), torch.rand(len(COUNTS), 3)
    with torch.no_grad():
        together = net(points, count, features)
        for i, n in enumerate(COUNTS):
            alone = net(points[i : i + 1, :n], count[i : i + 1], features[i : i + 1])
            torch.testing.assert_close(alone[0], together[i], atol=1e-5, rtol=1e-4)


def test_pointnet_does_not_see_the_order_of_points(padded):
    points, _ = padded
    net, count, features = PointNet(6).eval(), torch.full((3,), 40), torch.rand(3, 3)
    with torch.no_grad():
        torch.testing.assert_close(net(points.flip(1), count, features), net(points, count, features))


@pytest.mark.parametrize("network", [PointNet, PointNet2])
def test_networks_learn_to_tell_long_from_short(network):
    def batch(seed):
        rng = np.random.default_rng(seed)
        label = rng.integers(0, 2, 12)
        items = [network_inputs(contact(50, 8.0 + 8.0 * y, seed + i), rng) for i, y in enumerate(label)]
        return torch.utils.data.default_collate([x | {"label": int(y)} for x, y in zip(items, label, strict=True)])

    torch.manual_seed(0)
    net = network(2)
    optimizer = torch.optim.AdamW(net.parameters(), lr=2e-3)
    for step in range(10):
        optimizer.zero_grad()
        train.loss_of(net, batch(100 * step)).backward()
        optimizer.step()
    unseen = batch(9999)
    with torch.no_grad():
        answers = net(unseen["points"], unseen["count"], unseen["features"]).argmax(dim=1)
    assert (answers == unseen["label"]).float().mean() >= 0.9


def test_the_temperature_of_logits_three_times_too_large_is_three():
    rng = np.random.default_rng(2)
    honest = rng.normal(0, 2, (1500, 1, 5)).astype(np.float32)
    truth = np.array([rng.choice(5, p=row.astype(float) / row.sum(dtype=float)) for row in softmax(honest)[:, 0]])
    assert fitted_temperature(list(3 * honest), truth) == pytest.approx(3.0, rel=0.15)


@pytest.fixture(scope="module")
def workplace(tmp_path_factory):
    """A few clusters as both training and validation set, and networks of the pose."""
    folder = tmp_path_factory.mktemp("peers")
    few = datasets.make(Job("train", 6, 7), progress=False)
    hulls = {(few.name(i), int(few.hull_seed[i])) for i in range(len(few))}
    columns = {f.name: getattr(few, f.name) for f in fields(few) if f.init}
    made = ClusterSet(
        **{name: x if name in ONCE_A_SET else np.concatenate([x] * 14) for name, x in columns.items()}
    )
    surfaces = datasets.make_surfaces(sorted(hulls), progress=False)
    for name in ("train", "validation"):
        clusters.save(folder / f"data/{name}.npz", made)
        clusters.save(folder / f"data/{name}_surfaces.npz", surfaces)
    write_untrained(folder / "bundle")
    return folder


def test_a_mirrored_cloud_is_its_own_mirror_image_and_keeps_its_shape(workplace):
    mirrored.keep_pose_networks(workplace / "bundle", workplace / "pose")
    pipeline = mirrored.pose_pipeline(workplace / "pose", DEFAULT.vessels())
    seen = contact()
    cloud = mirrored.mirrored_cloud(pipeline, seen)
    assert len(cloud) == 2 * len(seen.points_level)
    own, image = np.split(cloud, 2)
    np.testing.assert_array_equal(image, own * [1, -1, 1])
    np.testing.assert_allclose(cdist(own, own), cdist(seen.points_level, seen.points_level), atol=1e-3)


def test_trained_peers_come_back_as_they_were_written(workplace):
    out = workplace / "out"
    for model in ("pointnet", "pointnet2", "mirrored_spd2"):
        common = ["--model", model, "--data", str(workplace / "data"), "--out", str(out), "--epochs", "1"]
        train.main([*common, "--bundle", str(workplace / "bundle")])
    peers = load_peers(out)
    assert [peer.name for peer in peers] == ["pointnet", "pointnet2", "mirrored_spd2"]
    for peer in peers:
        answer = peer.classify(contact())
        assert answer.shape == (len(DEFAULT.names) + 1,)
        assert answer.dtype == np.float32
        assert answer.sum() == pytest.approx(1.0, abs=1e-5)
        np.testing.assert_array_equal(peer.classify(contact()), answer)
        wanted = softmax(peer.logits(contact()) / np.float32(peer.temperature)).mean(axis=0)
        np.testing.assert_array_equal(answer, wanted)


def test_a_folder_without_trained_peers_gives_none(tmp_path):
    assert load_peers(tmp_path) == []
