"""Bow or stern: the votes point the right way and the probability is that of the answer given."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import ANGLES, BOAT, FakeModel, constant, heading_error_deg, properties
from shipshape.alignment import Look
from shipshape.first_look import FirstLook
from shipshape.stages import bow_stern
from shipshape.types import Pose

BOW, MIDDLE, STERN = np.eye(3, dtype=np.float32)
POSE = Pose(0.3, (50.0, 5.0, -3.0), BOAT)
ALONG = st.lists(st.floats(-6.0, 6.0, width=32), min_size=1, max_size=8)


def random_labels(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).dirichlet([1, 1, 1], count).astype(np.float32)


def labels_at(images: np.ndarray) -> list[np.ndarray]:
    """A network that reads the label (0 bow, 1 middle, 2 stern) off the image's first value."""
    return [10 * np.eye(3, dtype=np.float32)[images[:, 0, 0, 0].astype(int)]]


def images_of(labels: list[int]) -> np.ndarray:
    images = np.zeros((len(labels), 5, 16, 32), np.float32)
    images[:, 0, 0, 0] = labels
    return images


@properties()
@given(ALONG, st.integers(0, 1000))
def test_votes_change_sign_when_the_vessel_is_turned_round(along: list[float], seed: int) -> None:
    x, labels = np.array(along, np.float32), random_labels(len(along), seed)

    votes = bow_stern.part_votes(x, labels, BOAT.length)

    assert bow_stern.part_votes(-x, labels, BOAT.length) == pytest.approx(-votes, abs=1e-6)
    assert bow_stern.part_votes(x, labels[:, ::-1].copy(), BOAT.length) == pytest.approx(-votes, abs=1e-6)


def test_votes_are_counted_in_half_lengths() -> None:
    x = np.array([6.0, 0.0, -3.0], np.float32)

    assert bow_stern.part_votes(x, np.stack([BOW, BOW, STERN]), 12.0) == pytest.approx(1.0 + 0.0 + 0.5)
    assert bow_stern.part_votes(x, np.stack([MIDDLE] * 3), 12.0) == 0.0


@pytest.mark.parametrize(("labels", "flipped"), [([0, 1, 2], False), ([2, 1, 0], True)])
def test_the_bow_points_to_where_the_bow_parts_lie(labels: list[int], flipped: bool) -> None:
    along = np.array([5.0, 0.0, -5.0], np.float32)

    pose, probability = bow_stern.by_parts(images_of(labels), along, POSE, FakeModel(labels_at), sharpness=2.0)

    assert heading_error_deg(pose.heading, POSE.heading + math.pi * flipped) < 1e-6
    votes = 2 * 5.0 / 6.0  # two sure labels, five sixths of a half length off
    assert probability == pytest.approx(1 / (1 + math.exp(-2.0 * votes)), abs=1e-3)
    assert (pose.origin_level, pose.size) == (POSE.origin_level, POSE.size)


@properties()
@given(ALONG, st.integers(0, 1000), st.floats(0.0, 50.0))
def test_the_probability_is_that_of_the_way_chosen(along: list[float], seed: int, sharpness: float) -> None:
    logits = np.random.default_rng(seed).normal(0, 3, (len(along), 3)).astype(np.float32)
    images = np.zeros((len(along), 5, 16, 32), np.float32)
    x = np.array(along, np.float32)

    pose, probability = bow_stern.by_parts(images, x, POSE, constant(logits), sharpness=sharpness)

    turned = Pose(POSE.turned(math.pi).heading, POSE.origin_level, BOAT)
    other, again = bow_stern.by_parts(images, -x, turned, constant(logits), sharpness=sharpness)
    assert 0.5 <= probability <= 1.0
    assert again == pytest.approx(probability, abs=1e-6)
    if probability > 0.5 + 1e-6:  # both saw the same parts in the same places, so both must agree on the bow
        assert heading_error_deg(pose.heading, other.heading) < 1e-6


@pytest.mark.parametrize(
    ("image", "points", "flipped"), [(-3.0, 0.0, False), (3.0, 0.0, True), (0.0, 0.0, False), (3.0, -9.0, False)]
)
def test_the_looks_say_together_whether_to_turn_round(image: float, points: float, flipped: bool) -> None:
    pose, probability = bow_stern.by_networks(*looks(POSE, image, points), weights=[0.5, 0.25])

    assert heading_error_deg(pose.heading, POSE.heading + math.pi * flipped) < 1e-6
    assert probability == pytest.approx(1 / (1 + math.exp(-abs(0.5 * image + 0.25 * points))))


def looks(pose: Pose, image: float, points: float) -> tuple[Look, FirstLook]:
    """The bow that the first look saw lies aside of the axis: only its share along the axis counts."""
    back = np.array([math.cos(pose.heading), math.sin(pose.heading)]) * -points / 2
    aside = np.array([-math.sin(pose.heading), math.cos(pose.heading)])
    nothing = np.zeros(4, np.float32)
    return Look(pose, 0.1, image, nothing), FirstLook(pose, tuple((back + aside).tolist()), nothing)


@properties()
@given(ANGLES, st.floats(-1e6, 1e6))
def test_never_an_average_of_both_ways(yaw: float, flip_logit: float) -> None:
    start = Pose(yaw, POSE.origin_level, BOAT)

    pose, probability = bow_stern.by_networks(*looks(start, flip_logit, flip_logit), weights=[0.5, 0.5])

    error = heading_error_deg(pose.heading, yaw)
    assert min(error, 180.0 - error) < 1e-6
    assert 0.5 <= probability <= 1.0
