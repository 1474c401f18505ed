"""The comparison of both restorers, its sums and its page, on made-up answers."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

from shipshape_lab.experiments import generative, generative_spread
from shipshape_lab.experiments.pages import generative as page

FLOW = {"noise_seed": 1, "calibrated_again": True}


def made_up() -> np.ndarray:
    """Three clusters, the last refused: CD-L1, CD-L2, F-score, points, right, of every system."""
    found = np.full((3, 5, 5), np.nan)
    found[:, :, -1] = 0.0
    found[:2] = [0.01, 0.001, 0.8, 900, 1]
    found[:2, 2, 0] = [0.008, 0.006]  # flow_2 is nearer
    found[1, 3, -1] = 0  # flow_4 is wrong once
    return found


def numbers() -> dict:
    spread = np.tile([0.01, 0.009, 0.2, 0.05], (3, 5, 1))
    spread[:, 0, 2], spread[:, 0, 0] = [0.1, 0.2, 0.3], [0.03, 0.02, 0.01]
    spread[:, 1:, 2], spread[:, 1:, 0] = [[0.1], [0.2], [0.3]], [[0.01], [0.02], [0.03]]
    found = {f"P.restore_ms.{system}": 2.0 + place for place, system in enumerate(generative.SYSTEMS)}
    for name in ("P", "H"):
        found |= generative.of_answers(name, made_up())
        found |= generative_spread.of_spread(name, spread, generative.SYSTEMS)
    return found


def test_means_leave_refused_clusters_out_but_accuracy_does_not():
    found = numbers()
    assert found["P.cd_l1.deterministic"] == pytest.approx(10.0)
    assert found["P.cd_l1.flow_2"] == pytest.approx(7.0)
    assert found["P.accuracy.flow_2"] == pytest.approx(2 / 3)
    assert found["P.accuracy.flow_4"] == pytest.approx(1 / 3)


def test_the_lead_is_paired():
    found = numbers()
    assert found["P.cd_l1_lead.flow_2"] == pytest.approx(3.0)
    assert found["P.cd_l1_lead_error.flow_2"] == pytest.approx(1.0 / np.sqrt(2))
    assert found["P.cd_l1_lead.flow_8"] == pytest.approx(0.0)


def test_doubt_that_grows_with_the_error_ranks_it():
    found = numbers()
    assert found["H.doubt_rank.deterministic"] == pytest.approx(-1.0)
    assert found["H.doubt_rank.flow_4"] == pytest.approx(1.0)


def test_the_page_says_with_which_steps_the_flow_is_ahead():
    text = page.section(numbers(), {"flow": FLOW, "turns": 3, "machine": "a processor, 2 cores"})
    assert "| CD-L1 | 2 | 2 |" in text
    assert "| accuracy | none | none |" in text
    assert "| rank correlation of doubt | 1, 2, 4, 8 | 1, 2, 4, 8 |" in text
    assert "| flow, 2 steps | 7.00 | +3.00 (0.71) |" in text


@pytest.mark.parametrize(
    ("name", "unknown", "label", "counts"),
    [
        ("P", True, 1, True),
        ("H", True, 1, False),
        ("H", True, 2, True),
        ("H", False, 1, True),
        ("H", False, 2, False),
    ],
)
def test_right_is_the_vessel_on_p_and_the_decision_on_h(name, unknown, label, counts):
    said = SimpleNamespace(vessel="tug", unknown=unknown)
    assert generative.right(name, said, label, ["rhib", "tug"]) is counts
