"""Inpainting, whatever the network says: measured cells stay, and it is shown what the training showed it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import BOAT, FakeModel, constant, properties, random_points
from shipshape.raster import Layers, aligned_frame, rasterise, to_planes
from shipshape.stages import inpainting
from shipshape.types import Pose

SEEDS = st.integers(0, 2**32 - 1)
POSE = Pose(0.4, (30.0, 40.0, -3.0), BOAT)


def sparse_image(rng: np.random.Generator) -> np.ndarray:
    image = rng.integers(1, 256, (64, 64, 3))
    return np.where(rng.random(image.shape) < 0.1, image, 0).astype(np.uint8)


def measured_layers(seed: int) -> Layers:
    points = random_points(150, seed)
    points[:, 2] = np.abs(points[:, 2])
    return rasterise(points, aligned_frame(BOAT.length))


def answer(rng: np.random.Generator) -> list[np.ndarray]:
    """Noise in the shapes that the inpainting network gives."""
    shapes = [(1, 3, 32, 64)] * 3 + [(1, 2, 3, 32, 64), (1, 4)]
    return [rng.uniform(0, 1, shape).astype(np.float32) for shape in shapes]


@properties(20)
@given(SEEDS, st.floats(0.0, 1.0))
def test_grey_cells_that_were_measured_stay(seed: int, empty_below: float) -> None:
    rng = np.random.default_rng(seed)
    before = sparse_image(rng)
    noise = rng.uniform(-0.5, 1.5, (1, 3, 64, 64)).astype(np.float32)

    after = inpainting.inpaint_grey(before, constant(noise), empty_below=empty_below)

    assert after.dtype == np.uint8
    np.testing.assert_array_equal(after[before > 0], before[before > 0])
    filled = noise[0].transpose(1, 2, 0) >= empty_below
    np.testing.assert_array_equal((after > 0)[before == 0], filled[before == 0])


@pytest.mark.parametrize(
    ("share", "grey"), [(0.0, 0), (0.0999, 0), (0.1, 26), (0.5, 128), (1.0, 255), (1.7, 255), (-0.3, 0)]
)
def test_grey_shares_become_grey_values(share: float, grey: int) -> None:
    nothing = np.zeros((64, 64, 3), np.uint8)

    after = inpainting.inpaint_grey(
        nothing, constant(np.full((1, 3, 64, 64), share)), empty_below=float(np.float32(0.1))
    )

    assert np.unique(after).tolist() == [grey]


def test_the_grey_network_sees_the_picture_channels_first() -> None:
    before = np.zeros((64, 64, 3), np.uint8)
    before[3, 50, 2] = 255
    seen = []

    def echo(image: np.ndarray) -> list[np.ndarray]:
        seen.append(image)
        return [image]

    after = inpainting.inpaint_grey(before, FakeModel(echo), empty_below=0.01)

    assert seen[0].shape == (1, 3, 64, 64)
    assert seen[0].dtype == np.float32
    assert np.argwhere(seen[0]).tolist() == [[0, 2, 3, 50]]
    np.testing.assert_array_equal(after, before)


@properties(20)
@given(SEEDS)
def test_layers_that_were_measured_stay(seed: int) -> None:
    layers = measured_layers(seed)
    said = answer(np.random.default_rng(seed))

    filled, logits = inpainting.inpaint_layers(layers, POSE, 150, constant(*said))

    measured = layers.count > 0
    assert filled.occupied[measured].all()
    np.testing.assert_array_equal(filled.occupied[~measured], said[0][0][~measured] > 0.5)
    assert np.all(filled.top[measured] >= layers.top[measured])
    assert np.all(filled.bottom[measured] <= layers.bottom[measured])
    np.testing.assert_array_equal(filled.offset[:, measured], layers.offset[:, measured])
    np.testing.assert_array_equal(filled.offset[:, ~measured], said[3][0][:, ~measured])
    np.testing.assert_array_equal(filled.top[~measured], said[1][0][~measured])
    np.testing.assert_array_equal(filled.bottom[~measured], said[2][0][~measured])
    np.testing.assert_array_equal(logits, said[4][0])


def test_the_network_sees_the_image_and_its_mirror_about_the_keel() -> None:
    to_port = np.array([[3.0, 2.0, 0.5]], np.float32)
    to_starboard = to_port * np.float32([1, -1, 1])
    frame = aligned_frame(BOAT.length)

    planes, features = inpainting.network_inputs(rasterise(to_port, frame), POSE, 150)

    assert planes.shape == (18, 32, 64)
    np.testing.assert_array_equal(planes[:9], to_planes(rasterise(to_port, frame)))
    np.testing.assert_array_equal(planes[9:], to_planes(rasterise(to_starboard, frame)))
    np.testing.assert_allclose(features, [math.log(12.0), math.log(50.0), math.log(150)], rtol=1e-6)
