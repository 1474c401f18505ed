"""The compiled loops against SciPy and against slow references that are plain to read."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from builders import properties, random_points
from shipshape import kernels

SEEDS = st.integers(0, 2**32 - 1)
EDGES = np.array([0.0, 0.2, 0.5, 1.0], np.float32)
AS_THEY_ARE = ((0, 1, 2), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))  # points that are in pixels and shares already


@properties(30)
@given(SEEDS, st.integers(1, 200), st.floats(-math.pi, math.pi))
def test_extent_is_that_of_the_turned_points(seed: int, count: int, bearing: float) -> None:
    points = random_points(count, seed)
    cos, sin = math.cos(bearing), math.sin(bearing)
    turned = points.astype(np.float64) @ [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]

    found = kernels.extent(points, bearing)

    np.testing.assert_allclose(found.lower, turned.min(axis=0), atol=1e-5)
    np.testing.assert_allclose(found.upper, turned.max(axis=0), atol=1e-5)
    np.testing.assert_allclose(found.mean, turned.mean(axis=0), atol=1e-5)


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_mean_tells_of_a_broken_coordinate(broken: float, axis: int) -> None:
    points = random_points(50, 1)
    points[17, axis] = broken

    assert not np.isfinite(kernels.extent(points, 0.0).mean).all()


@properties(30)
@given(SEEDS, st.integers(1, 200), st.floats(0.1, 3.0))
def test_neighbours_are_those_that_scipy_counts(seed: int, count: int, radius: float) -> None:
    points = random_points(count, seed)

    found = kernels.count_neighbours(points, radius)

    tree = cKDTree(points.astype(np.float64))
    tight, wide = (
        [len(near) - 1 for near in tree.query_ball_point(points, r)] for r in (radius - 1e-5, radius + 1e-5)
    )
    assert found.dtype == np.int32
    assert np.all(found >= tight)
    assert np.all(found <= wide)


def test_a_neighbour_at_exactly_the_radius_counts() -> None:
    points = np.array([[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [1.0, 0, 0]], np.float32)

    np.testing.assert_array_equal(kernels.count_neighbours(points, 0.5), [2, 2, 1, 1])


def test_equal_points_are_each_others_neighbours() -> None:
    np.testing.assert_array_equal(kernels.count_neighbours(np.zeros((4, 3), np.float32), 0.5), [3, 3, 3, 3])


@properties(30)
@given(SEEDS, st.integers(1, 60), st.floats(0.2, 3.0))
def test_the_order_of_points_does_not_change_what_is_selected(seed: int, count: int, spacing: float) -> None:
    rng = np.random.default_rng(seed)
    points = np.rint(random_points(count, seed))  # a coarse grid, so that scores and coordinates tie
    scores = rng.integers(0, 4, count).astype(np.int32)
    order = rng.permutation(count)

    chosen = points[kernels.select_spread(points, scores, spacing, 5)]
    again = points[order][kernels.select_spread(points[order], scores[order], spacing, 5)]

    np.testing.assert_array_equal(chosen, again)


@properties(30)
@given(SEEDS, st.integers(1, 60), st.floats(0.2, 3.0), st.integers(1, 8))
def test_selection_is_the_greedy_one(seed: int, count: int, spacing: float, limit: int) -> None:
    points = random_points(count, seed)
    scores = np.random.default_rng(seed).integers(0, 5, count).astype(np.int32)

    chosen = kernels.select_spread(points, scores, spacing, limit)

    expected: list[int] = []
    for i in sorted(range(count), key=lambda i: (-scores[i], *points[i].tolist())):
        if len(expected) < limit and all(math.dist(points[i], points[j]) >= spacing for j in expected):
            expected.append(i)
    np.testing.assert_array_equal(chosen, expected)
    assert np.all(np.diff(scores[chosen]) <= 0)


def test_a_point_at_exactly_the_spacing_is_far_enough() -> None:
    points = np.array([[0, 0, 0], [0.5, 0, 0], [0.25, 0, 0]], np.float32)

    chosen = kernels.select_spread(points, np.array([3, 2, 1], np.int32), 0.5, 3)

    np.testing.assert_array_equal(chosen, [0, 1])


@properties(30)
@given(SEEDS, st.integers(0, 300))
def test_rasterise_fills_the_cells_that_numpy_fills(seed: int, count: int) -> None:
    rows, columns = 5, 8
    rng = np.random.default_rng(seed)
    points = rng.uniform((-1, -1, -0.3), (columns + 1, rows + 1, 1.3), (count, 3)).astype(np.float32)

    found = kernels.rasterise(points, *AS_THEY_ARE, EDGES, (rows, columns))

    u, v, depth = points.T
    inside = (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
    layer = np.clip(np.searchsorted(EDGES, depth, side="right") - 1, 0, len(EDGES) - 2)
    cell = (layer[inside], np.floor(v[inside]).astype(int), np.floor(u[inside]).astype(int))
    wanted_count = np.zeros((3, rows, columns), np.int32)
    np.add.at(wanted_count, cell, 1)
    top, bottom = np.full(wanted_count.shape, -np.inf), np.full(wanted_count.shape, np.inf)
    np.maximum.at(top, cell, depth[inside])
    np.minimum.at(bottom, cell, depth[inside])
    sums = np.zeros((2, *wanted_count.shape))
    np.add.at(sums[0], cell, u[inside] % 1 - 0.5)
    np.add.at(sums[1], cell, v[inside] % 1 - 0.5)
    seen = wanted_count > 0
    np.testing.assert_array_equal(found[0], wanted_count)
    np.testing.assert_array_equal(found[1], np.where(seen, top, 0).astype(np.float32))
    np.testing.assert_array_equal(found[2], np.where(seen, bottom, 0).astype(np.float32))
    np.testing.assert_allclose(found[3], sums / np.maximum(wanted_count, 1), atol=1e-5)


@pytest.mark.parametrize(("depth", "layer"), [(-5.0, 0), (0.0, 0), (0.2, 1), (0.49, 1), (0.5, 2), (7.0, 2)])
def test_a_layer_starts_at_its_lower_edge_and_the_outer_ones_are_open(depth: float, layer: int) -> None:
    point = np.array([[1.5, 0.5, depth]], np.float32)

    count, top, _, _ = kernels.rasterise(point, *AS_THEY_ARE, EDGES, (2, 3))

    assert np.argwhere(count).tolist() == [[layer, 0, 1]]
    assert top[layer, 0, 1] == np.float32(depth)


@properties(30)
@given(SEEDS, st.integers(0, 300), st.floats(0.5, 4.0))
def test_spherical_bins_are_those_of_numpy(seed: int, count: int, radius: float) -> None:
    shape = (3, 4, 8)
    centre = random_points(1, seed + 1, spread=0.5)[0]
    points = _off_the_edges(random_points(count, seed), centre, radius, shape)

    elsewhere = centre + np.float32(100.0)
    nothing, (found, nearest, farthest) = (
        [array[k] for array in kernels.bin_spherically(points, np.stack([elsewhere, centre]), radius, shape)]
        for k in range(2)
    )

    assert not any(array.any() for array in nothing)
    stratum, row, column, distance = _spherical(points, centre, radius, shape)
    near = distance < radius
    cell = tuple(np.floor(index[near]).astype(int) for index in (stratum, row, column))
    wanted = np.zeros(shape, np.int32)
    np.add.at(wanted, cell, 1)
    low, high = np.full(shape[1:], np.inf), np.zeros(shape[1:])
    np.minimum.at(low, cell[1:], distance[near])
    np.maximum.at(high, cell[1:], distance[near])
    np.testing.assert_array_equal(found, wanted)
    np.testing.assert_allclose(nearest, np.where(np.isinf(low), 0, low), atol=1e-5)
    np.testing.assert_allclose(farthest, high, atol=1e-5)


def _spherical(
    points: np.ndarray, centre: np.ndarray, radius: float, shape: tuple[int, int, int]
) -> tuple[np.ndarray, ...]:
    """Real-valued bin coordinates and the distance, in float64."""
    x, y, z = (points.astype(np.float64) - centre).T
    distance = np.sqrt(x * x + y * y + z * z)
    from_zenith, azimuth = np.arccos(z / distance), np.arctan2(y, x)
    strata, rows, columns = shape
    return (
        distance / radius * strata,
        from_zenith / np.pi * rows,
        (azimuth + np.pi) / (2 * np.pi) * columns,
        distance,
    )


def _off_the_edges(
    points: np.ndarray, centre: np.ndarray, radius: float, shape: tuple[int, int, int]
) -> np.ndarray:
    """The points that rounding cannot move to another bin."""
    *bins, distance = _spherical(points, centre, radius, shape)
    clear = [np.abs(index - np.rint(index)) > 1e-4 for index in bins]
    return points[np.all(clear, axis=0) & (np.abs(distance - radius) > 1e-4)]


def test_the_centre_is_not_its_own_neighbour() -> None:
    centre = np.array([1.0, 2.0, 3.0], np.float32)

    count, nearest, farthest = kernels.bin_spherically(centre[None], centre[None], 1.0, (3, 4, 8))

    assert not count.any()
    assert not nearest.any()
    assert not farthest.any()


@pytest.mark.parametrize(
    ("direction", "row", "column"),
    [
        ((0, 0, 1), 0, 4),
        ((0, 0, -1), 3, 4),
        ((1, 0.1, 0.1), 1, 4),
        ((-1, -0.1, -0.1), 2, 0),
        ((0.1, 1, -0.1), 2, 5),
    ],
)
def test_the_zenith_is_the_first_row_and_the_bow_the_middle_column(
    direction: tuple[float, float, float], row: int, column: int
) -> None:
    count, _, _ = kernels.bin_spherically(
        np.array([direction], np.float32), np.zeros((1, 3), np.float32), 3.0, (1, 4, 8)
    )

    assert np.argwhere(count).tolist() == [[0, 0, row, column]]


def lift_one(
    *, top: float, bottom: float, seen: tuple[float, float] | None = None, step: float = 0.1
) -> np.ndarray:
    """What `lift_columns` makes of a single cell at row 1, column 2 of a 3 x 4 image."""
    occupied = np.zeros((1, 3, 4), np.bool_)
    occupied[0, 1, 2] = True
    bounds = np.zeros((4, 1, 3, 4), np.float32)
    bounds[:, 0, 1, 2] = (top, bottom, *(seen or (0.0, 0.0)))
    count = np.zeros((1, 3, 4), np.int32)
    count[0, 1, 2] = 5 if seen else 0
    offset = np.zeros((2, 1, 3, 4), np.float32)
    offset[:, 0, 1, 2] = (0.25, -0.125)
    return kernels.lift_columns(occupied, (bounds[0], bounds[1]), (count, bounds[2], bounds[3]), offset, step)


def test_a_flat_cell_is_lifted_to_one_point_at_its_top() -> None:
    np.testing.assert_allclose(lift_one(top=0.5, bottom=0.48), [[2.75, 1.375, 0.5]])


def test_a_wall_is_lifted_to_a_column_one_step_apart() -> None:
    lifted = lift_one(top=0.5, bottom=0.1)

    np.testing.assert_allclose(lifted[:, :2], [[2.75, 1.375]] * len(lifted))
    assert len(lifted) in (4, 5)
    assert np.all(np.diff(lifted[:, 2]) <= 0.1 + 1e-6)
    assert lifted[:, 2].min() <= 0.1 + 0.051
    assert lifted[:, 2].max() >= 0.5 - 0.051


def test_what_was_measured_is_not_lifted_again() -> None:
    lifted = lift_one(top=1.0, bottom=0.0, seen=(0.6, 0.4))

    assert len(lifted)
    assert np.all((lifted[:, 2] < 0.35 + 1e-6) | (lifted[:, 2] > 0.65 - 1e-6))
    assert lifted[:, 2].min() < 0.1
    assert lifted[:, 2].max() > 0.9


def test_a_cell_measured_from_top_to_bottom_gives_nothing() -> None:
    assert lift_one(top=0.6, bottom=0.4, seen=(0.6, 0.4)).shape == (0, 3)


def test_an_empty_image_gives_nothing() -> None:
    nothing = np.zeros((3, 4, 5), np.bool_)

    depth, offset = np.ones((3, 4, 5), np.float32), np.zeros((2, 3, 4, 5), np.float32)

    lifted = kernels.lift_columns(
        nothing, (depth, depth), (np.ones((3, 4, 5), np.int32), depth, depth), offset, 0.1
    )

    assert lifted.shape == (0, 3)
    assert lifted.dtype == np.float32


def test_a_top_below_its_bottom_still_gives_one_point() -> None:
    np.testing.assert_allclose(lift_one(top=0.3, bottom=0.6), [[2.75, 1.375, 0.3]])
