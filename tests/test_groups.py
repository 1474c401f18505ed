"""Sampling and grouping of points, against SciPy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from builders import properties, random_points
from shipshape import kernels

SEEDS = st.integers(0, 2**32 - 1)


@properties(30)
@given(SEEDS, st.integers(1, 120), st.integers(1, 150))
def test_each_sampled_point_is_the_farthest_from_those_before(seed: int, count: int, most: int) -> None:
    points = random_points(count, seed)

    chosen = kernels.farthest_points(points, most)

    assert chosen[0] == 0
    assert len(set(chosen.tolist())) == len(chosen) == min(count, most)
    for k in range(1, len(chosen)):
        reach = cKDTree(points[chosen[:k]].astype(np.float64)).query(points)[0]
        assert reach[chosen[k]] >= reach.max() - 1e-5


def test_coinciding_points_are_sampled_once_each() -> None:
    assert sorted(kernels.farthest_points(np.ones((5, 3), np.float32), 8)) == [0, 1, 2, 3, 4]


@properties(30)
@given(SEEDS, st.integers(1, 120), st.floats(0.1, 3.0), st.integers(1, 20))
def test_a_ball_shows_an_even_share_of_what_scipy_finds_in_it(
    seed: int, count: int, radius: float, most: int
) -> None:
    points = random_points(count, seed)
    centres = points[::3].copy()

    members = kernels.in_ball(points, centres, radius, most)

    assert members.shape == (len(centres), most)
    tree = cKDTree(points.astype(np.float64))
    for c, found in enumerate(members.tolist()):
        tight, wide = (sorted(tree.query_ball_point(points[3 * c], r)) for r in (radius - 1e-5, radius + 1e-5))
        if tight != wide:
            continue  # a point on the very edge may fall on either side
        assert found == [tight[k * len(tight) // most] for k in range(most)]
        assert set(found) == set(tight) or len(tight) > most


@properties(30)
@given(SEEDS, st.integers(1, 40), st.integers(1, 20))
def test_groups_are_described_as_numpy_would(seed: int, count: int, most: int) -> None:
    points, centres = random_points(count, seed), random_points(7, seed + 1)
    members = np.random.default_rng(seed).integers(0, count, (7, most))

    planes = kernels.describe_groups(points, centres, members, (2.0, 10.0))

    offsets = (points[members] - centres[:, None]) / 2.0
    wanted = np.concatenate([offsets, points[members] / 10.0], axis=2).transpose(2, 0, 1)
    np.testing.assert_allclose(planes, wanted, atol=1e-5)
