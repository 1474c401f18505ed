"""Precision, recall and spread on answers whose outcome is known."""

import math
from dataclasses import replace

import pytest

pytest.importorskip("torch", reason="calibration is imported from training")

from shipshape.types import Reason
from shipshape_lab.experiments.pages import reasons as page
from shipshape_lab.experiments.reasons import Answer, of_answers

RIGHT = Answer(
    reasons=(),
    catalogue=True,
    named_right=True,
    bow_right=True,
    length_right=True,
    hidden_share=0.0,
    turn=0.5,
    range_m=50.0,
    off_ends_deg=60.0,
)
ANSWERS = [
    replace(RIGHT, reasons=(Reason.FEW_POINTS,), named_right=False, turn=1.5),
    replace(RIGHT, reasons=(Reason.FEW_POINTS,), range_m=160.0),
    replace(RIGHT, named_right=False, off_ends_deg=5.0, length_right=False),
    replace(RIGHT, reasons=(Reason.OCCLUDED,), hidden_share=0.4),
    replace(RIGHT, catalogue=False, reasons=(Reason.OUT_OF_CATALOGUE, Reason.FEW_POINTS), turn=9.0),
]


def test_each_code_is_held_to_what_it_warns_of():
    found = of_answers("H", ANSWERS)
    assert found["H.reason_given.best.few_points"] == 0.5, "a vessel outside the catalogue does not count"
    assert found["H.reason_precision.best.few_points"] == 0.5
    assert found["H.reason_recall.best.few_points"] == 0.5
    assert found["H.reason_recall.best.end_on"] == 0.0
    assert "H.reason_precision.best.end_on" not in found, "it was never given"
    assert found["H.reason_precision.best.occluded"] == found["H.reason_recall.best.occluded"] == 1.0
    assert found["H.reason_precision.best.out_of_catalogue"] == 1.0
    assert "H.reason_recall.best.bow_uncertain" not in found, "no bow was wrong"


def test_the_spread_counts_vessels_of_the_catalogue_by_range_and_angle():
    found = of_answers("H", ANSWERS)
    assert found["H.heading_std.best.within_1std"] == 0.75
    assert found["H.heading_std.best.within_2std"] == 1.0
    assert found["H.heading_std.best.within_1std.25_60m"] == pytest.approx(2 / 3)
    assert found["H.heading_std.best.within_1std.150_200m"] == 1.0
    assert found["H.heading_std.best.within_1std.off_ends_0_15deg"] == 1.0


def test_a_set_that_does_not_say_what_was_hidden_says_nothing_of_it():
    found = of_answers("H", [replace(answer, hidden_share=math.nan) for answer in ANSWERS])
    assert not [key for key in found if "occluded" in key]
    assert "| `occluded` | a fifth of the returns hidden | - | - | - |" in page.section(found, {"sets": ["H"]})
