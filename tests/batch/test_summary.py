import numpy as np
import pyarrow as pa
import pytest

from shipshape.batch import rows
from shipshape.batch.summary import REFUSALS, Tally


def part(*contacts: dict) -> pa.Table:
    usual = {"unit": "", "input_sha256": "", "message": 0, "points": 50, "bundle": "b", "code": "c"}
    return pa.Table.from_pylist([{**usual, **contact} for contact in contacts], rows.PART)


def answered(ms: float, vessel: str = "tug", **more) -> dict:
    stages = [("prior", ms / 4), ("heading", ms * 3 / 4)]
    return {"vessel": vessel, "unknown": False, "probability": 0.9, "reasons": [], "stage_ms": stages, **more}


def test_percentiles_are_those_of_the_milliseconds():
    times = np.random.default_rng(0).lognormal(1.0, 0.7, 5000)
    tally = Tally()
    for some in np.split(times, 50):
        tally.add(part(*map(answered, some.tolist())))
    for percent in (50, 90, 99):
        assert tally.percentile_ms(percent) == pytest.approx(np.percentile(times, percent), rel=0.06)
    assert tally.stage_ms["prior"] == pytest.approx(times.sum() / 4)
    assert tally.ms.sum() == len(times)


def test_contacts_are_counted_by_what_they_are_called_and_why_they_are_doubted():
    tally = Tally()
    tally.add(
        part(
            answered(1.0),
            answered(2.0, "rhib", reasons=["end_on", "occluded"]),
            answered(3.0, "rhib", unknown=True, reasons=["end_on"]),
            {"error": "expected at least 10 points in a cluster, got 3"},
            {"error": "expected at least 10 points in a cluster, got 7"},
        )
    )
    assert tally.vessels == {"tug": 1, "rhib": 1, "unknown": 1}
    assert tally.reasons == {"end_on": 2, "occluded": 1}
    assert tally.refusals == {"expected at least 10 points in a cluster": 2}
    assert (tally.contacts, tally.answered, tally.refused) == (5, 3, 2)
    assert tally.probability.sum() == 3


def test_a_run_without_answers_has_no_percentiles():
    tally = Tally()
    tally.add(part({"error": "expected, got"}))
    assert tally.percentile_ms(50) is None


def test_very_many_kinds_of_refusals_take_little_room():
    tally = Tally()
    tally.add(part(*[{"error": f"expected {number}, got none"} for number in range(3 * REFUSALS)]))
    assert len(tally.refusals) == REFUSALS + 1
    assert tally.refused == 3 * REFUSALS
