"""Numbers of the ladder on answers whose outcome is known."""

import math

import numpy as np
import pytest

pytest.importorskip("torch", reason="examples are imported from training")

from shipshape.types import Rung
from shipshape_lab.experiments.ladder import of_answers
from shipshape_lab.experiments.pages import ladder as page

NAN = math.nan
FULL = np.array([(1, 1.0, 2.0, 0.5, 1, 3.0), (1, 1.0, 8.0, 2.0, 0, 5.0), (0, 0.0, NAN, NAN, NAN, 4.0)])
LOWER = np.array([(1, 1.0, 1.0, 0.2, 1, 1.0), (1, 0.5, 3.0, 0.9, 1, 1.0), (1, 0.5, NAN, NAN, NAN, 1.0)])
FOUND = {Rung.FULL: FULL, Rung.WITHOUT_RESTORATION: LOWER, Rung.HEADING_AND_BOX: LOWER}


def test_each_rung_is_judged_by_its_own_answers():
    numbers = of_answers("H", FOUND)
    assert numbers["H.ladder.clusters"] == 3
    assert numbers["H.ladder.accuracy.full"] == pytest.approx(2 / 3)
    assert numbers["H.ladder.ece.full"] == 0.0
    assert numbers["H.ladder.ece.without_restoration"] == pytest.approx(1 / 3)
    assert numbers["H.ladder.ms.full"] == 4.0


def test_a_vessel_outside_the_catalogue_has_no_heading_to_be_right_about():
    numbers = of_answers("H", FOUND)
    assert numbers["H.ladder.heading_median_deg.full"] == 5.0
    assert numbers["H.ladder.heading_within_5deg.full"] == 0.5
    assert numbers["H.ladder.within_1std.full"] == 0.5
    assert numbers["H.ladder.bow_stern.full"] == 0.5


def test_the_page_has_a_row_for_every_rung():
    text = page.section(of_answers("H", FOUND), {"sets": ["H"]})
    assert "| `full` | 66.67 | 0.00 | 50.00 | 50.00 | 50.00 | 5.00 | 4.00 |" in text
    assert all(f"| `{rung}` |" in text for rung in Rung)
