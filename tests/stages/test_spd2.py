"""SPD2: the symmetries that its definition promises."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import properties, random_points, turn_level
from shipshape.stages import spd2

RADIUS = 3.0
CENTRE = np.zeros((1, 3), np.float32)


def mid_column_points(count: int, seed: int) -> np.ndarray:
    """Points in the middle of azimuth columns and off every other edge, so that rounding moves none."""
    rng = np.random.default_rng(seed)
    azimuth = (rng.integers(0, 32, count) + 0.5) * math.tau / 32 - math.pi
    elevation = math.pi / 2 - (rng.integers(0, 16, count) + rng.uniform(0.1, 0.9, count)) * math.pi / 16
    distance = (rng.integers(0, 3, count) + rng.uniform(0.1, 0.9, count)) * RADIUS / 3
    flat = np.cos(elevation)
    direction = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
    return (direction * distance[:, None]).astype(np.float32)


@properties(20)
@given(st.integers(0, 2**32 - 1), st.integers(-40, 40))
def test_turning_the_cloud_by_one_column_shifts_the_columns(seed: int, columns: int) -> None:
    points = mid_column_points(100, seed)

    image = spd2.describe(points, CENTRE, RADIUS)
    turned = spd2.describe(turn_level(points, columns * math.tau / 32), CENTRE, RADIUS)

    np.testing.assert_allclose(turned, np.roll(image, columns, axis=3), atol=1e-5)
    assert image.any()


@properties(20)
@given(st.integers(0, 2**32 - 1))
def test_turning_upside_down_turns_the_rows(seed: int) -> None:
    points = mid_column_points(100, seed)

    image = spd2.describe(points, CENTRE, RADIUS)
    below = spd2.describe(points * np.float32([1, 1, -1]), CENTRE, RADIUS)

    np.testing.assert_allclose(below, image[:, :, ::-1], atol=1e-5)


@properties(30)
@given(st.integers(0, 2**32 - 1), st.integers(0, 300), st.floats(0.2, 8.0))
def test_every_channel_stays_between_0_and_1(seed: int, count: int, radius: float) -> None:
    images = spd2.describe(random_points(count, seed), random_points(3, seed + 1), radius)

    assert images.shape == (3, 5, 16, 32)
    assert images.dtype == np.float32
    assert images.min() >= 0.0
    assert images.max() <= 1.0


@pytest.mark.parametrize("points", [np.zeros((0, 3)), [[0, 0, 0]], [[9, 0, 0], [0, RADIUS, 0]]])
def test_an_empty_neighbourhood_is_all_zero(points: list[list[float]]) -> None:
    assert not spd2.describe(np.array(points, np.float32), CENTRE, RADIUS).any()


def test_the_values_of_one_direction() -> None:
    # Three points dead ahead of the keypoint, slightly above it: two in the near shell and one in the far one.
    along = np.array([0.3, 0.9, 2.7])
    points = (along[:, None] * [math.cos(0.05), 0.0, math.sin(0.05)] + [0, 1e-3, 0]).astype(np.float32)

    (image,) = spd2.describe(points, CENTRE, RADIUS)

    expected = [1 - math.exp(-1.0), 0.0, 1 - math.exp(-0.5), 1 - 0.1, 0.8]
    np.testing.assert_allclose(image[:, 7, 16], expected, atol=1e-4)
    assert np.count_nonzero(image) == 4


def test_images_move_with_their_keypoints() -> None:
    points, away = mid_column_points(50, seed=5), np.float32([[8.0, -16.0, 32.0]])

    images = spd2.describe(np.concatenate([points, points + away]), np.concatenate([CENTRE, away]), RADIUS)

    np.testing.assert_allclose(images[1], images[0], atol=1e-4)


def test_no_keypoints_give_no_images() -> None:
    assert spd2.describe(random_points(10, seed=1), CENTRE[:0], RADIUS).shape == (0, 5, 16, 32)
