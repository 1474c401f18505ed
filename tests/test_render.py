import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from builders_recognition import SIZE, recognised
from shipshape.render import render_png
from shipshape.render.canvas import Canvas, Font, Rect
from shipshape.render.cluster_panels import draw_cluster_from_above
from shipshape.render.image_panels import draw_image
from shipshape.render.style import BACKGROUND, INFERRED, MEASURED
from shipshape.render.text_panels import draw_stages, vessel_title
from shipshape.render.views import View, bow_line, box_corners, from_above, from_direction
from shipshape.types import Box, Contact, ImagePair, Preset, RestoredCloud


def decoded(png: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)


def share_near(picture: np.ndarray, colour: tuple[int, int, int]) -> float:
    return float((np.abs(picture.astype(int) - colour).max(axis=2) < 40).mean())


@pytest.mark.parametrize("preset", list(Preset))
@pytest.mark.parametrize("unknown", [True, False])
def test_the_picture_is_a_png_that_shows_measured_and_inferred(preset, unknown):
    picture = decoded(render_png(*recognised(preset=preset, unknown=unknown)))
    assert picture.shape == (900, 1600, 3)
    assert share_near(picture, MEASURED) > 0.001
    bare = decoded(render_png(*recognised(preset=preset, unknown=unknown, inferred=0)))
    assert share_near(picture, INFERRED) > 0.0005 + share_near(bare, INFERRED)


def test_a_picture_is_the_same_every_time_from_any_thread():
    contact, recognition = recognised()
    with ThreadPoolExecutor(4) as pool:
        pictures = set(pool.map(lambda _: render_png(contact, recognition), range(8)))
    assert len(pictures) == 1


def test_what_is_missing_leaves_its_place_empty():
    contact, recognition = recognised(inferred=0)
    none = np.empty((0, 3), np.float32)
    sparse = replace(
        recognition, stage_ms={}, keypoints_level=none, images=ImagePair(*[np.zeros((1, 1, 3), np.uint8)] * 2)
    )
    assert decoded(render_png(contact, sparse)).shape == (900, 1600, 3)
    empty = replace(sparse, restored=RestoredCloud(none, np.empty(0, bool)))
    assert decoded(render_png(contact, empty)).shape == (900, 1600, 3)


def test_many_classes_and_long_names_fit():
    contact, recognition = recognised()
    many = {f"a_rather_long_vessel_name_number_{i}": 0.01 for i in range(99)} | {"unknown": 0.01}
    assert render_png(contact, replace(recognition, probabilities=many, vessel=next(iter(many))))


@settings(max_examples=8, deadline=None)
@given(heading=st.floats(-math.pi, math.pi), unknown=st.booleans())
def test_any_heading_can_be_drawn(heading, unknown):
    contact, recognition = recognised(heading=heading, unknown=unknown, inferred=10)
    assert render_png(contact, recognition).startswith(b"\x89PNG")


def test_one_point_can_be_drawn():
    contact, recognition = recognised()
    assert render_png(Contact(contact.points_level[:1]), recognition)


def test_an_unknown_vessel_is_called_so():
    assert vessel_title(recognised(unknown=True)[1]) == ("unknown", "most like pilot boat")
    assert vessel_title(recognised()[1]) == ("pilot boat", "")


def test_a_long_contact_id_leaves_the_facts_readable():
    contact, recognition = recognised()
    long, longer = (
        decoded(render_png(replace(contact, contact_id="x" * count), recognition)) for count in (40, 256)
    )
    np.testing.assert_array_equal(long, longer)


def test_a_long_time_leaves_the_words_beside_it_readable():
    drawn = []
    canvas = Canvas(800, 200, (0, 0, 0))
    canvas.text = lambda text, position, font: drawn.append((text, position[0])) or 8.0 * len(text)
    draw_stages(canvas, Rect(0.0, 0.0, 700.0, 100.0), replace(recognised()[1], stage_ms={"prior": 123456.7}))
    (number, left), (_, beside), *_ = drawn
    assert beside > left + 8.0 * len(number)


def test_layers_that_lie_over_each_other_show_the_nearest_in_its_colour():
    image = np.zeros((1, 3, 3), np.uint8)
    image[0, 0] = 255  # all three layers
    image[0, 1, 0] = 255  # the farthest alone
    canvas = Canvas(30, 10, (0, 0, 0))
    draw_image(canvas, Rect(0.0, 0.0, 30.0, 10.0), image)
    shown = decoded(canvas.to_png())
    assert shown[5, 5].tolist() == [80, 90, 255]
    assert shown[5, 15].tolist() == [255, 120, 60]
    assert shown[5, 25].tolist() == list(BACKGROUND)


@settings(max_examples=20, deadline=None)
@given(bearing=st.floats(-math.pi, math.pi))
def test_the_line_of_sight_ends_before_the_cluster(bearing):
    middle = np.array([50 * math.cos(bearing), 50 * math.sin(bearing), 0])
    points = middle + np.random.default_rng(0).uniform(-4, 4, (200, 3))
    canvas, ends = Canvas(300, 300, (0, 0, 0)), []
    canvas.arrow = lambda start, end, colour, **form: ends.append((start, end))
    canvas.dots = lambda places, colours, radius: ends.append(places)
    draw_cluster_from_above(canvas, Rect(40.0, 40.0, 220.0, 220.0), Contact(points.astype(np.float32)))
    places, (start, end) = ends
    apart = np.hypot(*(places - end).T).min()
    assert apart >= 9.9
    assert 0 < min(start) < max(start) < 300
    assert np.dot(np.subtract(end, start), places.mean(axis=0) - start) > 0


def test_from_above_ahead_is_up_and_port_is_left():
    view = View(
        Canvas(200, 200, (0, 0, 0)),
        Rect(0.0, 0.0, 200.0, 200.0),
        from_above(),
        np.array([[-5.0, -5, 0], [5, 5, 0]]),
    )
    assert view.pixels_per_metre == 20
    np.testing.assert_allclose(view.spot((0.0, 0.0, 0.0)), (100, 100))
    np.testing.assert_allclose(view.spot((5.0, 0.0, 9.0)), (100, 0), atol=1e-9)
    np.testing.assert_allclose(view.spot((0.0, 5.0, 9.0)), (0, 100), atol=1e-9)


def test_seen_from_port_abeam_the_bow_is_left_and_up_is_up():
    # heading 0: bow along +x; the viewer stands at +y, its port side
    seen = from_direction(math.pi / 2)
    np.testing.assert_allclose(seen(np.array([[1.0, 0, 0], [0, 0, 1]])), [[-1, 0], [0, 1]], atol=1e-12)
    assert seen.nearness(np.array([[0.0, 2, 0]]))[0] == pytest.approx(2)


@given(azimuth=st.floats(-4, 4), elevation=st.floats(-1.5, 1.5))
def test_a_view_is_a_right_handed_rotation(azimuth, elevation):
    view = from_direction(azimuth, elevation)
    axes = np.array([view.right, view.up, view.viewer])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)


def test_box_corners_start_at_the_port_bow_on_the_waterline():
    corners = box_corners(Box((10.0, 0.0, 1.5), SIZE), math.pi / 2)  # bow along +y, port along -x
    np.testing.assert_allclose(corners[0], (8, 6, 0), atol=1e-12)
    np.testing.assert_allclose(corners[1], (12, 6, 0), atol=1e-12)
    np.testing.assert_allclose(corners[4], (8, 6, 3), atol=1e-12)
    middle, tip = bow_line(Box((10.0, 0.0, 1.5), SIZE), math.pi / 2)
    np.testing.assert_allclose(middle, (10, 0, 0))
    assert tip[1] > 6


@pytest.mark.parametrize("text", ["a\udcffb", "\ud800", "", "a\0b", "two\nlines", "\u0301", "\U0001f6a2"])
def test_any_text_can_be_drawn(text):
    canvas = Canvas(100, 50, (0, 0, 0))
    font = Font((255, 255, 255))
    assert canvas.text(text, (5.0, 30.0), font) == canvas.text_width(text, font) >= 0
