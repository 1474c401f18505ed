"""Keypoints against a brute-force reading of the paper's definition."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from builders import properties, random_points
from shipshape.stages.keypoints import KeypointParams, select_keypoints


def brute_force(points: np.ndarray, params: KeypointParams) -> list[list[float]]:
    """Rank by number of others within r, then walk down and keep those d_min from all kept."""
    cloud = [tuple(point) for point in points.tolist()]
    density = [sum(math.dist(p, q) <= params.radius for q in cloud) - 1 for p in cloud]
    kept: list[tuple[float, ...]] = []
    for _, point in sorted((-n, p) for n, p in zip(density, cloud, strict=True)):
        if len(kept) < params.limit and all(math.dist(point, other) >= params.spacing for other in kept):
            kept.append(point)
    return [list(point) for point in kept]


@properties(30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 80), st.floats(0.3, 2.0), st.floats(0.3, 2.0))
def test_keypoints_are_the_densest_that_keep_their_distance(
    seed: int, count: int, radius: float, spacing: float
) -> None:
    points = random_points(count, seed, spread=1.5)
    params = KeypointParams(radius, spacing, limit=5)

    np.testing.assert_array_equal(select_keypoints(points, params), brute_force(points, params))


def test_the_papers_values_are_the_default() -> None:
    assert KeypointParams() == KeypointParams(radius=0.5, spacing=0.5, limit=3)


def test_the_middle_of_the_densest_clump_comes_first() -> None:
    clumps = [random_points(count, seed=count, spread=0.2) + at for count, at in ((5, 0), (20, 5), (10, -5))]

    found = select_keypoints(np.concatenate(clumps).astype(np.float32), KeypointParams())

    np.testing.assert_array_equal(np.rint(found[:, 0] / 5), [1, -1, 0])


@properties(20)
@given(st.integers(0, 2**32 - 1))
def test_the_order_of_the_cloud_does_not_matter(seed: int) -> None:
    points = random_points(60, seed, spread=1.0)
    shuffled = np.random.default_rng(seed).permutation(points)

    np.testing.assert_array_equal(
        select_keypoints(points, KeypointParams()), select_keypoints(shuffled, KeypointParams())
    )


def test_a_small_cloud_gives_fewer() -> None:
    together = np.float32([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]])

    assert select_keypoints(together, KeypointParams()).shape == (1, 3)
    assert select_keypoints(together[:0], KeypointParams()).shape == (0, 3)


def test_the_densest_place_of_a_crowded_cloud_is_still_found() -> None:
    rng = np.random.default_rng(1)
    sparse = rng.uniform(-10, 10, (30_000, 3))
    crowd = rng.normal([4.0, -3.0, 1.0], 0.1, (30_000, 3))
    points = rng.permutation(np.concatenate([sparse, crowd])).astype(np.float32)
    densest = select_keypoints(points, KeypointParams(limit=1))[0]
    assert np.linalg.norm(densest - [4.0, -3.0, 1.0]) < 0.3
