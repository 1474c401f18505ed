"""What is compared of two answers: class, heading with the half turn told apart, probabilities, box."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from serving.fakes import FakeWork, cluster, recognition_of
from shipshape.serving.comparison import Numbers, compare, numbers_of
from shipshape.serving.encoding import Wishes
from shipshape.serving.model import Answer
from shipshape.types import Box, Contact, Options, ReferenceBox

NUMBERS = Numbers("tug", {"tug": 0.75, "rhib": 0.125, "unknown": 0.125}, 0.5, ReferenceBox(20.0, 8.0, 10.0))


def turned(degrees):
    return replace(NUMBERS, heading=math.remainder(NUMBERS.heading + math.radians(degrees), math.tau))


def test_the_numbers_of_an_answer():
    contact = Contact(cluster())
    found = recognition_of(FakeWork(contact, Options()), {})
    assert numbers_of(Answer(contact, found), Wishes()) == NUMBERS
    unknown = replace(found, unknown=True, box=Box((0.0, 0.0, 0.0), ReferenceBox(1.0, 2.0, 3.0)))
    numbers = numbers_of(Answer(contact, unknown), Wishes())
    assert (numbers.vessel, numbers.box.beam) == ("unknown", 2.0)


def test_the_same_answer_does_not_differ():
    found = compare(NUMBERS, NUMBERS)
    assert found.same
    assert (found.axis_deg, found.opposite, found.probability, found.box_m) == (0, False, 0, 0)


@pytest.mark.parametrize(
    ("degrees", "axis", "opposite"),
    [
        (3, 3, False),
        (-3, 3, False),
        (359, 1, False),
        (89, 89, False),
        (91, 89, True),
        (180, 0, True),
        (184, 4, True),
    ],
)
def test_a_half_turn_is_told_apart(degrees, axis, opposite):
    found = compare(NUMBERS, turned(degrees))
    assert found.axis_deg == pytest.approx(axis)
    assert found.opposite is opposite


def test_probability_that_lies_elsewhere():
    other = replace(NUMBERS, vessel="ferry", probabilities={"ferry": 0.75, "unknown": 0.25})
    found = compare(NUMBERS, other)
    assert not found.same
    assert found.vessels == ("tug", "ferry")
    assert found.probability == pytest.approx(0.875)


def test_the_side_of_the_box_that_differs_most():
    assert compare(NUMBERS, replace(NUMBERS, box=ReferenceBox(19.0, 8.5, 12.5))).box_m == 2.5


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_headings_however_they_lie(one, other):
    there, back = (
        compare(replace(NUMBERS, heading=first), replace(NUMBERS, heading=second))
        for first, second in ((one, other), (other, one))
    )
    assert 0 <= there.axis_deg <= 90 + 1e-9
    assert there == back
