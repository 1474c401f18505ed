"""What is refused, as what, and that the message names what was expected and what came."""

import numpy as np
import pytest
from hypothesis import given

from builders import ANGLES, BOAT, contact_of, properties, seen_hull, turn_level, whole_hull
from shipshape.errors import InvalidInput, TooLarge, Unprocessable
from shipshape.types import Contact, Pose, ReferenceBox
from shipshape.validation import ContactLimits, check_contact

LIMITS = ContactLimits()
GOOD = seen_hull(Pose(0.5, (40.0, 5.0, -3.0), BOAT))


def smuggled(points: np.ndarray) -> Contact:
    """A contact whose array is of another shape than its type says, as only unchecked callers can make it."""
    contact = contact_of(GOOD)
    object.__setattr__(contact, "points_level", points)
    return contact


def with_point(x: float, y: float, z: float) -> np.ndarray:
    return np.concatenate([GOOD, np.array([[x, y, z]], np.float32)])


def spread(across: float, distance: float = 40.0) -> np.ndarray:
    """A cluster of 20 points, `across` metres wide."""
    y = np.linspace(-across / 2, across / 2, 20)
    return np.column_stack([np.full(20, distance), y, np.linspace(-3, 0, 20)]).astype(np.float32)


def test_a_vessels_cluster_is_accepted() -> None:
    check_contact(contact_of(GOOD, sensor_height=4.0, own_true_heading_deg=270.0), LIMITS)


@pytest.mark.parametrize("shape", [(0,), (30,), (10, 2), (10, 4), (1, 10, 3)])
def test_another_shape_is_invalid_input(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInput) as refused:
        check_contact(smuggled(np.zeros(shape, np.float32)), LIMITS)

    assert type(refused.value) is InvalidInput
    assert "expected points of shape (n, 3)" in str(refused.value)
    assert f"got {shape}" in str(refused.value)


@pytest.mark.parametrize("count", [0, 1, 9])
def test_too_few_points_are_unprocessable(count: int) -> None:
    with pytest.raises(Unprocessable, match=rf"expected at least 10 points.* got {count}$"):
        check_contact(contact_of(GOOD[:count]), LIMITS)


def test_ten_points_are_enough() -> None:
    check_contact(contact_of(spread(8.0)[::2]), LIMITS)


def test_a_million_points_are_too_large() -> None:
    with pytest.raises(TooLarge, match=r"expected at most 65536 points.* got 1000000: split a scan"):
        check_contact(contact_of(np.zeros((1_000_000, 3))), LIMITS)


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_coordinates_that_are_no_numbers_are_unprocessable(broken: float, axis: int) -> None:
    points = GOOD.copy()
    points[[3, 7], axis] = broken

    with pytest.raises(Unprocessable, match=r"expected finite coordinates, got 2 points with NaN or infinity"):
        check_contact(contact_of(points), LIMITS)


def test_coordinates_whose_difference_overflows_are_refused_without_a_warning() -> None:
    with pytest.raises(Unprocessable, match="at most 150 m across"):
        check_contact(contact_of(np.concatenate([with_point(3e38, 0, 0), with_point(-3e38, 0, 0)])), LIMITS)


@pytest.mark.parametrize(("across", "told"), [(5_000.0, "5000.0 m"), (151.0, "151.0 m")])
def test_a_scene_is_not_a_vessel(across: float, told: str) -> None:
    with pytest.raises(Unprocessable, match=rf"expected .*at most 150 m across, got {told}: split a scan"):
        check_contact(contact_of(spread(across, distance=500.0)), LIMITS)


def test_spray_is_not_a_vessel() -> None:
    with pytest.raises(Unprocessable, match=r"expected a cluster at least 0\.5 m across, got 0\.30 m"):
        check_contact(contact_of(spread(0.3)), LIMITS)


def test_a_cluster_around_the_sensor_is_not_in_the_level_frame() -> None:
    with pytest.raises(Unprocessable, match=r"expected .*level frame.*got points on all sides of the origin"):
        check_contact(contact_of(GOOD - GOOD.mean(axis=0)), LIMITS)


@pytest.mark.parametrize("turn", [(1, 1), (-1, 1), (1, -1), (-1, -1)])
def test_a_cluster_beyond_every_lidar_is_refused_on_every_side(turn: tuple[int, int]) -> None:
    points = (GOOD + np.float32([2_000, 0, 0])) * np.float32([*turn, 1])

    with pytest.raises(Unprocessable, match=r"expected a cluster within 1000 m, got one at 20\d\d m"):
        check_contact(contact_of(points), LIMITS)


@pytest.mark.parametrize("height", [0.0, -1.0, 200.0, np.nan, np.inf])
def test_an_impossible_sensor_height_is_refused(height: float) -> None:
    with pytest.raises(Unprocessable, match=rf"expected a sensor height between 0 and 200 m.* got {height}"):
        check_contact(contact_of(GOOD, sensor_height=float(height)), LIMITS)


@pytest.mark.parametrize("heading", [np.nan, np.inf])
def test_an_own_heading_that_is_no_number_is_refused(heading: float) -> None:
    with pytest.raises(Unprocessable, match=rf"expected the own true heading in degrees, got {heading}"):
        check_contact(contact_of(GOOD, own_true_heading_deg=float(heading)), LIMITS)


def test_limits_are_the_callers_to_set() -> None:
    with pytest.raises(Unprocessable, match=r"at least 5000 points"):
        check_contact(contact_of(GOOD), ContactLimits(min_points=5_000))


def test_a_cluster_under_the_water_is_refused() -> None:
    points = np.random.default_rng(0).uniform([20, -3, -4], [28, 3, -3], (50, 3)).astype(np.float32)
    check_contact(Contact(points, sensor_height=3.5), ContactLimits())
    expected = r"above the water, which is at z = -2 m, got a highest point at z = -3"
    with pytest.raises(Unprocessable, match=expected):
        check_contact(Contact(points, sensor_height=2.0), ContactLimits())


def verdict(points: np.ndarray) -> str:
    try:
        check_contact(contact_of(points), LIMITS)
    except InvalidInput as refused:
        return str(refused).partition(", got ")[0]
    return "accepted"


LONG = ReferenceBox(length=20.0, beam=4.0, height=3.0)
JUDGED = {
    "abreast, 6 m off": (whole_hull(Pose(0.0, (0.0, 8.0, -3.0), LONG)), "accepted"),
    "around the sensor": (whole_hull(Pose(0.0, (2.0, 1.0, -3.0), LONG)), "expected a cluster in the level frame"),
    "149 m": (spread(149.0), "accepted"),
    "180 m": (spread(180.0), "expected one vessel's cluster, at most 150 m across"),
    "a line through the sensor": (spread(20.0, distance=0.0), "expected a cluster in the level frame"),
    "two far ends": (np.repeat([[40, 0, 0], [40, 140, 0]], 5, axis=0), "accepted"),
    "spray": (spread(0.4), "expected a cluster at least 0.5 m across"),
    "a point": (np.full((20, 3), 30.0), "expected a cluster at least 0.5 m across"),
    "a mast": (
        np.linspace([40, 0, -3], [40.6, 0, 160], 50),
        "expected one vessel's cluster, at most 150 m across",
    ),
    "too far": (GOOD + np.float32([1_010, 0, 0]), "expected a cluster within 1000 m"),
}


@pytest.mark.parametrize("case", JUDGED)
@properties(30)
@given(turn=ANGLES)
def test_turning_the_world_changes_no_verdict(case: str, turn: float) -> None:
    points, expected = JUDGED[case]
    assert verdict(turn_level(np.asarray(points, np.float32), turn)).startswith(expected)


def test_a_hull_of_very_many_corners_takes_little_memory_and_keeps_its_size() -> None:
    angles = np.linspace(-np.pi, np.pi, LIMITS.max_points, endpoint=False)
    circle = np.column_stack([300 + 75.2 * np.cos(angles), 75.2 * np.sin(angles), 0 * angles])
    assert verdict(circle) == "expected one vessel's cluster, at most 150 m across"
    assert verdict(circle * [0.99, 0.99, 1]) == "accepted"
