"""Lifting: what was measured comes first and unchanged; what was inferred lies where the image says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from builders import BOAT, noisy, properties, seen_hull, whole_hull
from shipshape import raster
from shipshape.raster import FilledLayers, Layers, aligned_frame
from shipshape.stages import lifting, projection
from shipshape.types import ImageMethod, Pose

POSE = Pose(2.0, (35.0, 20.0, -3.0), BOAT)
FRAME = aligned_frame(BOAT.length)
PIXEL = FRAME.pixel[0]


def layers_of(points_level: np.ndarray) -> Layers:
    return projection.project(points_level, POSE, FRAME)


def filled_with(points_level: np.ndarray) -> FilledLayers:
    """A perfect inpainting: the layers of the points themselves."""
    layers = layers_of(points_level)
    return FilledLayers(layers.count > 0, layers.top, layers.bottom, layers.offset)


@properties(20)
@given(st.integers(0, 2**32 - 1))
def test_measured_points_come_first_unchanged_and_flagged(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cluster = noisy(seen_hull(POSE), seed=seed)
    top = rng.uniform(0, 1, (3, 32, 64)).astype(np.float32)
    filled = FilledLayers(
        rng.random(top.shape) < 0.2, top, top / 2, rng.uniform(-0.5, 0.5, (2, *top.shape)).astype(np.float32)
    )

    restored = lifting.lift_layers(cluster, layers_of(cluster), filled, POSE, FRAME)

    np.testing.assert_array_equal(restored.points_level[: len(cluster)], cluster)
    np.testing.assert_array_equal(restored.measured, np.arange(len(restored.measured)) < len(cluster))
    assert len(restored.points_level) == len(restored.measured) > len(cluster)
    assert restored.points_level.dtype == np.float32


def test_nothing_inpainted_leaves_the_cluster() -> None:
    cluster = seen_hull(POSE)
    layers = layers_of(cluster)
    nothing = FilledLayers(np.zeros_like(layers.count, np.bool_), layers.top, layers.bottom, layers.offset)

    restored = lifting.lift_layers(cluster, layers, nothing, POSE, FRAME)

    np.testing.assert_array_equal(restored.points_level, cluster)
    assert restored.measured.all()


def test_a_perfect_inpainting_brings_the_hidden_sides_back() -> None:
    hull, cluster = whole_hull(POSE, step=0.1), seen_hull(POSE, step=0.1)

    restored = lifting.lift_layers(cluster, layers_of(cluster), filled_with(hull), POSE, FRAME)

    missing, _ = cKDTree(restored.points_level).query(hull)
    invented, _ = cKDTree(hull).query(restored.points_level)
    assert missing.max() < 1.5 * PIXEL
    assert invented.max() < 1.5 * PIXEL
    assert cKDTree(cluster).query(hull)[0].max() > 3.0  # the cluster alone lacks much of the hull


def test_inferred_points_are_not_put_where_it_was_measured() -> None:
    cluster = whole_hull(POSE, step=0.05)

    restored = lifting.lift_layers(cluster, layers_of(cluster), filled_with(cluster), POSE, FRAME)

    assert restored.measured.all()


def test_an_inferred_cell_lands_on_its_spot() -> None:
    cluster = seen_hull(POSE)
    occupied = np.zeros((3, 32, 64), np.bool_)
    occupied[1, 15, 63] = True
    depth = np.full(occupied.shape, 0.25, np.float32)
    offset = np.zeros((2, *occupied.shape), np.float32)
    offset[0, 1, 15, 63], offset[1, 1, 15, 63] = -0.5, 0.25

    restored = lifting.lift_layers(
        cluster, layers_of(cluster), FilledLayers(occupied, depth, depth, offset), POSE, FRAME
    )

    (inferred,) = POSE.to_vessel(restored.points_level[~restored.measured])
    # One whole pixel from the right edge; row 15.75 of 32, a quarter pixel to port; a quarter of the depth.
    expected = (0.6 * 12.0 - PIXEL, 0.25 * PIXEL, 0.25 * 0.6 * 12.0)
    np.testing.assert_allclose(inferred, expected, atol=1e-4)


@pytest.mark.parametrize("method", list(ImageMethod))
def test_grey_lifting_flags_what_was_there_before(method: ImageMethod) -> None:
    frame = projection.paper_frame(method, BOAT, BOAT.length)
    before, after = (
        raster.to_grey(layers.count > 0, layers.top, frame)
        for layers in (projection.project(points, POSE, frame) for points in (seen_hull(POSE), whole_hull(POSE)))
    )
    after = np.where(before > 0, before, after)

    restored = lifting.lift_grey(before, after, POSE, frame)

    assert restored.measured.sum() == np.count_nonzero(before)
    assert len(restored.measured) == np.count_nonzero(after)
    width, height = frame.pixel
    reach = np.hypot(np.hypot(width, height) / 2, frame.depth_range / 3) + 0.2
    apart, _ = cKDTree(seen_hull(POSE)).query(restored.points_level[restored.measured])
    assert apart.max() < reach


def test_an_empty_picture_lifts_to_no_points() -> None:
    frame = projection.paper_frame(ImageMethod.FULL_TOP, BOAT, BOAT.length)
    empty = np.zeros((64, 64, 3), np.uint8)

    restored = lifting.lift_grey(empty, empty, POSE, frame)

    assert restored.points_level.shape == (0, 3)
    assert restored.measured.shape == (0,)
