"""Images and back: every point is found again where it was, and the picture is the right way up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import properties, random_points
from shipshape.raster import (
    ImageFrame,
    Layers,
    aligned_frame,
    from_grey,
    rasterise,
    to_grey,
    to_metres,
    to_planes,
)

TOP = ImageFrame((0, 1, 2), (-6.0, -3.0, 0.0), (6.0, 3.0, 4.0), (16, 32), (0.0, 0.25, 0.5, 1.0))
SIDE = ImageFrame((0, 2, 1), (-6.0, 0.0, -3.0), (6.0, 4.0, 3.0), (16, 32), (0.0, 1 / 3, 2 / 3, 1.0))
FRAMES = pytest.mark.parametrize("frame", [TOP, SIDE, aligned_frame(10.0)], ids=["top", "side", "aligned"])


def inside(frame: ImageFrame, count: int, seed: int) -> np.ndarray:
    """Random points well inside the image, metres."""
    lower, upper = np.empty(3), np.empty(3)
    lower[list(frame.axes)], upper[list(frame.axes)] = frame.lower, frame.upper
    return np.random.default_rng(seed).uniform(lower + 1e-3, upper - 1e-3, (count, 3)).astype(np.float32)


def lit(points: list[tuple[float, float, float]], frame: ImageFrame) -> tuple[int, int, int]:
    """Layer, row and column of the one cell that the points light."""
    cells = np.argwhere(rasterise(np.array(points, np.float32), frame).count)
    assert len(cells) == 1
    return tuple(cells[0].tolist())


@FRAMES
@properties(30)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_lone_point_is_found_again_exactly(frame: ImageFrame, seed: int) -> None:
    point = inside(frame, 1, seed)

    layers = rasterise(point, frame)
    layer, row, column = (index.astype(np.float32) for index in np.nonzero(layers.count))
    cell = np.nonzero(layers.count)
    back = to_metres(
        column + 0.5 + layers.offset[0][cell], row + 0.5 + layers.offset[1][cell], layers.top[cell], frame
    )

    assert layer.shape == (1,)
    np.testing.assert_allclose(back, point, atol=1e-4)


@FRAMES
@properties(20)
@given(seed=st.integers(0, 2**32 - 1))
def test_every_point_lies_within_half_a_pixel_of_its_cell_and_between_its_depths(
    frame: ImageFrame, seed: int
) -> None:
    points = inside(frame, 60, seed)

    layers = rasterise(points, frame)

    cell = np.nonzero(layers.count)
    middle = [index.astype(np.float32) + 0.5 for index in cell]
    tops = to_metres(middle[2], middle[1], layers.top[cell], frame)
    bottoms = to_metres(middle[2], middle[1], layers.bottom[cell], frame)
    across, up, deep = frame.axes
    width, height = frame.pixel
    for point in points:
        near = (np.abs(tops[:, across] - point[across]) <= width / 2 + 1e-4) & (
            np.abs(tops[:, up] - point[up]) <= height / 2 + 1e-4
        )
        between = (bottoms[:, deep] - 1e-4 <= point[deep]) & (point[deep] <= tops[:, deep] + 1e-4)
        assert np.any(near & between)
    assert layers.count.sum() == len(points)


def test_in_the_top_view_the_bow_is_right_and_port_is_up() -> None:
    rows, columns = TOP.shape

    assert lit([(5.9, -2.9, 1.5)], TOP) == (1, rows - 1, columns - 1)
    assert lit([(-5.9, 2.9, 1.5)], TOP) == (1, 0, 0)


def test_in_the_side_view_the_bow_is_right_and_up_is_up() -> None:
    rows, columns = SIDE.shape

    assert lit([(5.9, 2.9, 3.9)], SIDE) == (2, 0, columns - 1)
    assert lit([(-5.9, -2.9, 0.1)], SIDE) == (0, rows - 1, 0)


@pytest.mark.parametrize("outside", [(6.1, 0, 1), (-6.1, 0, 1), (0, 3.1, 1), (0, -3.1, 1)])
def test_what_lies_beside_the_image_is_left_out(outside: tuple[float, float, float]) -> None:
    assert not rasterise(np.array([outside], np.float32), TOP).count.any()


def test_no_points_make_an_empty_image() -> None:
    layers = rasterise(np.zeros((0, 3), np.float32), TOP)

    assert layers.count.shape == (3, 16, 32)
    assert not layers.count.any()


@FRAMES
def test_pixels_and_metres_agree_at_the_corners(frame: ImageFrame) -> None:
    rows, columns = frame.shape
    corner = np.float32([0.0]), np.float32([rows]), np.float32([0.0])

    low = to_metres(*corner, frame)[0]
    high = to_metres(np.float32([columns]), np.float32([0.0]), np.float32([1.0]), frame)[0]

    np.testing.assert_allclose(low[list(frame.axes)], frame.lower, atol=1e-5)
    np.testing.assert_allclose(high[list(frame.axes)], frame.upper, atol=1e-5)


@properties(30)
@given(st.integers(0, 2**32 - 1))
def test_grey_values_hold_depths_within_half_a_step(seed: int) -> None:
    points = inside(TOP, 200, seed)
    layers = rasterise(points, TOP)
    occupied = layers.count > 0

    grey = to_grey(occupied, layers.top, TOP)
    back = from_grey(grey, TOP)

    steps = np.diff(TOP.edges)[:, None, None] / 254
    assert grey.shape == (*TOP.shape, 3)
    np.testing.assert_array_equal(grey.transpose(2, 0, 1) > 0, occupied)
    assert np.all(np.abs(back - layers.top)[occupied] <= np.broadcast_to(steps / 2 + 1e-6, back.shape)[occupied])


def test_grey_runs_from_1_at_the_bottom_of_a_layer_to_255_at_its_top() -> None:
    occupied = np.ones((3, 1, 2), np.bool_)
    depth = np.array([[[0.0, 0.2499]], [[0.25, 0.4999]], [[0.5, 1.0]]], np.float32)

    np.testing.assert_array_equal(to_grey(occupied, depth, TOP), [[[1, 1, 1], [255, 255, 255]]])


def test_blue_is_the_lowest_layer_and_red_the_highest() -> None:
    low, high = np.array([[0.1, 0.1, 0.1]], np.float32), np.array([[0.1, 0.1, 3.9]], np.float32)

    for points, channel in ((low, 0), (high, 2)):
        layers = rasterise(points, TOP)
        grey = to_grey(layers.count > 0, layers.top, TOP)
        assert np.flatnonzero(grey.any(axis=(0, 1))).tolist() == [channel]


def test_depths_beyond_the_image_are_the_darkest_and_brightest_grey() -> None:
    layers = rasterise(np.array([[0.1, 0.1, -9.0], [3.1, 0.1, 99.0]], np.float32), TOP)

    grey = to_grey(layers.count > 0, layers.top, TOP)

    assert sorted(grey[grey > 0].tolist()) == [1, 255]


def test_planes_are_occupancy_top_and_bottom_in_that_order() -> None:
    layers = rasterise(np.array([[0.1, 0.1, 0.4], [0.1, 0.1, 0.8], [0.1, 0.1, 90.0]], np.float32), TOP)

    planes = to_planes(layers)

    assert planes.shape == (9, *TOP.shape)
    assert planes.dtype == np.float32
    row, column = 7, 16
    np.testing.assert_allclose(planes[:, row, column], [1, 0, 1, 0.2, 0, 1, 0.1, 0, 1], atol=1e-6)
    assert planes.sum() == pytest.approx(4.3, abs=1e-5)


@properties(20)
@given(st.floats(2.0, 80.0), st.integers(0, 2**32 - 1))
def test_vessels_of_one_shape_fill_the_aligned_image_alike(length: float, seed: int) -> None:
    shape = random_points(50, seed, spread=0.25)

    small, large = (_shares(shape, scale) for scale in (1.0, length))

    np.testing.assert_array_equal(small.count, large.count)
    np.testing.assert_allclose(small.top, large.top, atol=1e-4)


def _shares(shape: np.ndarray, length: float) -> Layers:
    """The aligned image of `shape`, given in lengths of the vessel, off the cell edges."""
    snapped = (np.floor(np.abs(shape) / 0.01875) + 0.5) * 0.01875 * np.where(shape < 0, -1, 1)
    snapped[:, 2] = np.abs(snapped[:, 2])
    return rasterise((snapped * length).astype(np.float32), aligned_frame(length))


def test_pixels_of_the_aligned_image_are_square() -> None:
    width, height = aligned_frame(17.0).pixel

    assert width == pytest.approx(height)
    assert width == pytest.approx(17.0 * 1.2 / 64)
