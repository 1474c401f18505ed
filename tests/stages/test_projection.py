"""The paper's four images: what they show, at which scale, and that lifting undoes them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import ANGLES, BOAT, box_faces, place, properties
from shipshape import raster
from shipshape.raster import ImageFrame
from shipshape.stages import lifting, projection
from shipshape.types import ImageMethod, Pose, ReferenceBox

METHODS = pytest.mark.parametrize("method", list(ImageMethod))
SIZES = st.builds(ReferenceBox, st.floats(6.0, 30.0), st.floats(2.0, 11.0), st.floats(1.0, 14.0))
LONGEST = 30.0


def bounds_by_axis(frame: ImageFrame) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = np.empty(3), np.empty(3)
    lower[list(frame.axes)], upper[list(frame.axes)] = frame.lower, frame.upper
    return lower, upper


@METHODS
@properties(50)
@given(size=SIZES)
def test_every_image_holds_the_whole_reference_box(method: ImageMethod, size: ReferenceBox) -> None:
    lower, upper = bounds_by_axis(projection.paper_frame(method, size, LONGEST))

    half = np.array([size.length / 2, size.beam / 2])
    assert np.all(lower[:2] < -half)
    assert np.all(upper[:2] > half)
    assert lower[2] == 0.0
    assert upper[2] > size.height


@METHODS
@properties(20)
@given(size=SIZES, yaw=ANGLES, seed=st.integers(0, 2**32 - 1))
def test_points_come_back_within_a_pixel(method: ImageMethod, size: ReferenceBox, yaw: float, seed: int) -> None:
    """Projecting, drawing and lifting without any inpainting gives every point back."""
    frame = projection.paper_frame(method, size, LONGEST)
    pose = Pose(yaw, (40.0, -8.0, -3.0), size)
    hull = np.random.default_rng(seed).uniform((-0.5, -0.5, 0.01), (0.5, 0.5, 0.99), (40, 3))
    points_vessel = (hull * (size.length, size.beam, size.height)).astype(np.float32)

    layers = projection.project(place(points_vessel, pose), pose, frame)
    image = raster.to_grey(layers.count > 0, layers.top, frame)
    restored = lifting.lift_grey(image, image, pose, frame)

    lifted = pose.to_vessel(restored.points_level)
    width, height = frame.pixel
    layer_depth = frame.depth_range / 3
    across, up, deep = frame.axes
    apart = np.abs(points_vessel[:, None] - lifted[None])
    near = (
        (apart[..., across] < width / 2 + 1e-3)
        & (apart[..., up] < height / 2 + 1e-3)
        & (apart[..., deep] < layer_depth + 1e-3)
    )
    assert restored.measured.all()
    assert np.all(near.any(axis=1)), "a point was lost"
    assert np.all(near.any(axis=0)), "a point was made up"


@METHODS
@properties(30)
@given(yaw=ANGLES, seed=st.integers(0, 2**32 - 1))
def test_a_lone_point_comes_back_at_its_own_depth(method: ImageMethod, yaw: float, seed: int) -> None:
    frame = projection.paper_frame(method, BOAT, LONGEST)
    pose = Pose(yaw, (40.0, -8.0, -3.0), BOAT)
    point = np.random.default_rng(seed).uniform((-5.9, -1.9, 0.05), (5.9, 1.9, 2.95), (1, 3)).astype(np.float32)

    layers = projection.project(place(point, pose), pose, frame)
    image = raster.to_grey(layers.count > 0, layers.top, frame)
    lifted = pose.to_vessel(lifting.lift_grey(image, image, pose, frame).points_level)

    limits = np.empty(3)
    limits[list(frame.axes)] = (frame.pixel[0] / 2, frame.pixel[1] / 2, frame.depth_range / 3 / 254 / 2)
    assert lifted.shape == (1, 3)
    assert np.all(np.abs(lifted - point)[0] < limits + 1e-3)


@pytest.mark.parametrize("method", [ImageMethod.FULL_TOP, ImageMethod.FULL_SIDE])
def test_full_images_scale_every_axis_alike_by_the_vessels_own_extent(method: ImageMethod) -> None:
    frame = projection.paper_frame(method, BOAT, LONGEST)
    twice = projection.paper_frame(method, ReferenceBox(24.0, 8.0, 6.0), LONGEST)

    assert frame.shape == (64, 64)
    assert frame.pixel[0] == pytest.approx(frame.pixel[1])
    np.testing.assert_allclose(2 * np.array(frame.upper), twice.upper)


@pytest.mark.parametrize("method", [ImageMethod.Z_TOP, ImageMethod.Z_SIDE])
def test_z_images_keep_one_scale_for_the_catalogue_and_stretch_the_height(method: ImageMethod) -> None:
    frame = projection.paper_frame(method, BOAT, LONGEST)
    tall = projection.paper_frame(method, ReferenceBox(20.0, 8.0, 9.0), LONGEST)

    assert frame.shape == (64, 64)
    assert frame.pixel[0] == tall.pixel[0]
    np.testing.assert_allclose(bounds_by_axis(tall)[1][2], 3 * bounds_by_axis(frame)[1][2])


@METHODS
def test_the_three_layers_are_equal_thirds_of_the_depth(method: ImageMethod) -> None:
    assert projection.paper_frame(method, BOAT, LONGEST).edges == pytest.approx((0, 1 / 3, 2 / 3, 1))


@pytest.mark.parametrize(
    ("method", "face", "channel"),
    [
        (ImageMethod.Z_TOP, "deck", 2),
        (ImageMethod.FULL_SIDE, "port", 2),
        (ImageMethod.Z_SIDE, "port", 2),
        (ImageMethod.FULL_SIDE, "starboard", 0),
        (ImageMethod.Z_SIDE, "starboard", 0),
    ],
)
def test_the_face_nearest_the_viewer_is_red(method: ImageMethod, face: str, channel: int) -> None:
    pose = Pose(0.8, (40.0, -8.0, -3.0), BOAT)
    frame = projection.paper_frame(method, BOAT, LONGEST)

    layers = projection.project(place(box_faces(BOAT)[face], pose), pose, frame)

    image = raster.to_grey(layers.count > 0, layers.top, frame)
    assert np.flatnonzero(image.any(axis=(0, 1))).tolist() == [channel]


@METHODS
def test_the_bow_is_on_the_right(method: ImageMethod) -> None:
    pose = Pose(-2.2, (40.0, -8.0, -3.0), BOAT)
    frame = projection.paper_frame(method, BOAT, LONGEST)

    layers = projection.project(place(box_faces(BOAT)["bow"], pose), pose, frame)

    _, _, columns = np.nonzero(layers.count)
    assert columns.min() > 32
