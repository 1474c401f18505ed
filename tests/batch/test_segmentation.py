"""Simulated harbours, of which it is known which point is of which vessel, and real scans."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders_recognition import side_of_hull
from shipshape.batch.method import Segmentation
from shipshape.batch.segmentation import segment
from shipshape.pointfiles import read_clusters

SHARED = Path(__file__).parents[3] / "shared" / "data" / "lidar"
needs_lidar = pytest.mark.skipif(
    not SHARED.is_dir(), reason="the real scans beside the checkout (../shared/data) are absent"
)
HEIGHT = 3.0  # m, of the LiDAR above the water
HOW = Segmentation()


def water(rng: np.random.Generator, count: int = 800) -> np.ndarray:
    """Returns of waves within 40 m."""
    points = rng.uniform(-40, 40, (count, 3))
    points[:, 2] = rng.normal(-HEIGHT, 0.1, count)
    return points.astype(np.float32)


def own_deck(rng: np.random.Generator, count: int = 400) -> np.ndarray:
    return rng.uniform((-9, -3, -2), (9, 3, 1), (count, 3)).astype(np.float32)


def shuffled(rng: np.random.Generator, *clouds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One scan, and of each point the number of the cloud that it is of."""
    whose = np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds])
    order = rng.permutation(len(whose))
    return np.concatenate(clouds)[order], whose[order]


def agreement(clusters: list[np.ndarray], vessel: np.ndarray) -> float:
    """Of the cluster and the dry points of a vessel that fit best: what they share, of what either has."""
    truth = {tuple(point) for point in vessel[vessel[:, 2] > HOW.water_band - HEIGHT].tolist()}
    found = [{tuple(point) for point in cluster.tolist()} for cluster in clusters]
    return max((len(truth & points) / len(truth | points) for points in found), default=0.0)


def test_vessels_are_told_from_water_deck_and_one_another():
    rng = np.random.default_rng(3)
    vessels = [
        side_of_hull(heading, (*place, -HEIGHT), count=300)
        for heading, place in ((0.5, (40.0, 5.0)), (2.0, (55.0, -20.0)), (-1.0, (-30.0, 30.0)))
    ]
    scan, _ = shuffled(rng, *vessels, water(rng), own_deck(rng))
    clusters, height = segment(scan, HOW, HEIGHT)
    assert len(clusters) == len(vessels)
    assert height == HEIGHT
    assert min(agreement(clusters, vessel) for vessel in vessels) == 1.0


def test_the_water_is_found_without_the_height_of_the_lidar():
    rng = np.random.default_rng(4)
    vessel = side_of_hull(0.5, (40.0, 5.0, -HEIGHT), count=300)
    scan, _ = shuffled(rng, vessel, water(rng), own_deck(rng))
    clusters, height = segment(scan, HOW, None)
    assert height == pytest.approx(HEIGHT, abs=0.4)
    assert agreement(clusters, vessel) > 0.9


def test_points_that_are_farther_apart_than_the_gap_are_of_two_vessels():
    line = np.column_stack([np.full(40, 30.0), np.linspace(-10, 10, 40), np.ones(40)]).astype(np.float32)
    for gap, distance, count in ((2.0, 1.5, 1), (2.0, 3.0, 2), (4.0, 3.0, 1), (4.0, 5.5, 2)):
        beside = line + np.float32([distance, 0, 0])
        assert len(segment(np.concatenate([line, beside]), Segmentation(gap=gap), HEIGHT)[0]) == count


@pytest.mark.parametrize(
    "points",
    [
        np.empty((0, 3)),
        np.full((50, 3), np.nan),
        np.zeros((50, 3)),
        np.tile([30.0, 0.0, 1.0], (5, 1)),
        np.array([[1e30, 0, 1], [-1e30, 5, 1]] * 20),
    ],
    ids=["none", "nan", "own", "few", "huge"],
)
def test_scans_without_a_vessel_have_no_clusters_that_could_be_one(points):
    clusters, _ = segment(points.astype(np.float32), HOW, HEIGHT)
    assert all(len(cluster) == 20 for cluster in clusters)
    assert not clusters or abs(points).max() == 1e30


@given(
    points=st.lists(
        st.tuples(*[st.floats(-200, 200, width=32)] * 2, st.floats(-4, 20, width=32)), min_size=1, max_size=60
    ),
    seed=st.integers(0, 2**32 - 1),
)
def test_clusters_are_parts_of_the_scan_whatever_the_order_of_its_points(points, seed):
    scan = np.unique(np.array(points, np.float32), axis=0)
    clusters, _ = segment(scan, Segmentation(min_points=1), HEIGHT)
    joined = [tuple(point) for cluster in clusters for point in cluster.tolist()]
    assert len(joined) == len(set(joined))
    assert set(joined) <= {tuple(point) for point in scan.tolist()}
    again, _ = segment(np.random.default_rng(seed).permutation(scan), Segmentation(min_points=1), HEIGHT)
    assert [{tuple(p) for p in cluster.tolist()} for cluster in clusters] == [
        {tuple(p) for p in cluster.tolist()} for cluster in again
    ]


def real_places(scenario: str, every: int = 60) -> list[np.ndarray]:
    """Where vessels around a real ferry were at some moments, level frame of a ferry that heads north, (n, 2)."""
    folder = SHARED / "autoferry"
    truth = json.loads((folder / f"{scenario}_groundTruth.json").read_text())
    own = json.loads((folder / f"{scenario}_detections.json").read_text())
    moments = []
    for vessels, ferry in list(zip(truth, own, strict=True))[::every]:
        there = [np.subtract(vessel["position"][:2], ferry["ownshipPosition"]) for vessel in vessels]
        near = [(north, -east) for north, east in there if 30 < math.hypot(north, east) < 200]
        moments.append(np.array(near).reshape(-1, 2))
    return moments


@needs_lidar
@pytest.mark.parametrize("scenario", ["scenario2", "scenario13"])
def test_vessels_where_real_ones_were_are_found_at_each_moment(scenario):
    rng = np.random.default_rng(6)
    seen = 0
    for places in real_places(scenario):
        if len(places) == 2 and np.linalg.norm(places[0] - places[1]) < 18:
            continue  # alongside: nobody could tell them apart from above
        hulls = [
            side_of_hull(float(rng.uniform(-3, 3)), (*place, -HEIGHT), count=200) for place in places.tolist()
        ]
        scan, _ = shuffled(rng, *hulls, water(rng), own_deck(rng))
        clusters, _ = segment(scan, HOW, HEIGHT)
        assert len(clusters) == len(hulls)
        assert all(agreement(clusters, hull) == 1.0 for hull in hulls)
        seen += len(hulls)
    assert seen > 20


@needs_lidar
def test_real_scans_of_other_sensors_are_split_into_parts_of_themselves():
    for file in ("hesai_64_1673403880898440686.pcd", "velodyne_vlp16_1673400472138016708.pcd"):
        (scan,) = read_clusters(SHARED / "nebula" / file)
        clusters, _ = segment(scan, HOW, None)
        assert clusters
        assert sum(map(len, clusters)) <= len(scan)
        assert min(map(len, clusters)) >= HOW.min_points
        assert math.isfinite(sum(float(cluster.sum()) for cluster in clusters))
