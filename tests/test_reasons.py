"""Reason codes on hulls whose silhouette is known, and rules at their thresholds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from builders import ANGLES, BOAT, box_faces, contact_of, noisy, place, properties, seen_hull
from builders_models import CATALOGUE, untrained_bundle
from shipshape.pipeline import Pipeline
from shipshape.reasons import Measures, measure, missing_share, reasons_of
from shipshape.types import Options, Pose, Preset, Reason, RestoredCloud

THRESHOLDS = {"few_points": 40, "end_on_deg": 15.0, "occluded_above": 0.3, "bow_below": 0.9}
SURE = Measures(points=40, off_ends_deg=15.0, missing_share=0.3, bow_probability=0.9)
ABEAM = Pose(math.pi / 2, (60.0, 0.0, -3.0), BOAT)  # bow to port, starboard toward the sensor


def restored(measured: np.ndarray, pose: Pose) -> RestoredCloud:
    """A box hull of which `measured` (level frame) was seen."""
    hull = place(np.concatenate(list(box_faces(pose.size).values())), pose)
    cloud = np.concatenate([measured, hull])
    return RestoredCloud(cloud, np.arange(len(cloud)) < len(measured))


def side() -> np.ndarray:
    """The whole side of the boat that the sensor sees, vessel frame."""
    length, beam, height = BOAT.length, BOAT.beam, BOAT.height
    low, high = (-length / 2, -beam / 2, 0.0), (length / 2, -beam / 2, height)
    return np.random.default_rng(4).uniform(low, high, (3000, 3)).astype(np.float32)


def missing(points_vessel: np.ndarray, pose: Pose = ABEAM) -> float:
    x, y, water = pose.origin_level
    return missing_share(restored(place(points_vessel, pose), pose), math.atan2(y, x), water)


def test_nothing_is_missing_of_a_side_that_was_seen_whole():
    assert missing(side()) < 0.12


@pytest.mark.parametrize("hidden", [0.25, 0.4])
@pytest.mark.parametrize("end", ["bow", "middle"])
def test_a_part_hidden_is_missing(hidden, end):
    x = side()[:, 0] / BOAT.length + 0.5
    gone = x > 1 - hidden if end == "bow" else np.abs(x - 0.5) < hidden / 2
    assert missing(side()[~gone]) == pytest.approx(hidden, abs=0.08)


def test_thinning_everywhere_alike_hides_nothing():
    kept = np.random.default_rng(0).random(len(side())) < 0.5
    assert missing(side()[kept]) < 0.2


def test_what_was_not_measured_at_all_is_missing():
    cloud = restored(np.empty((0, 3), np.float32), ABEAM)
    assert missing_share(cloud, 0.0, -3.0) == 1.0


@properties(20)
@given(ANGLES)
def test_no_bearing_changes_what_is_missing(bearing):
    half = side()[side()[:, 0] < 1.0]
    turned = Pose(ABEAM.heading + bearing, (60.0 * math.cos(bearing), 60.0 * math.sin(bearing), -3.0), BOAT)
    assert missing(half, turned) == pytest.approx(missing(half), abs=0.05)


def test_on_its_threshold_no_reason_holds():
    assert reasons_of(SURE, unknown=False, thresholds=THRESHOLDS) == ()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"points": 39}, Reason.FEW_POINTS),
        ({"off_ends_deg": 14.9}, Reason.END_ON),
        ({"missing_share": 0.31}, Reason.OCCLUDED),
        ({"bow_probability": 0.89}, Reason.BOW_UNCERTAIN),
    ],
)
def test_beyond_its_threshold_a_reason_holds(change, reason):
    assert reasons_of(replace(SURE, **change), unknown=False, thresholds=THRESHOLDS) == (reason,)


def test_unknown_is_a_reason_and_all_may_hold_at_once():
    doubtful = Measures(points=10, off_ends_deg=0.0, missing_share=1.0, bow_probability=0.5)
    assert reasons_of(SURE, unknown=True, thresholds=THRESHOLDS) == (Reason.OUT_OF_CATALOGUE,)
    assert reasons_of(doubtful, unknown=True, thresholds=THRESHOLDS) == tuple(Reason)


def test_without_thresholds_only_unknown_is_told():
    doubtful = Measures(points=10, off_ends_deg=0.0, missing_share=1.0, bow_probability=0.5)
    assert reasons_of(doubtful, unknown=True, thresholds={}) == (Reason.OUT_OF_CATALOGUE,)
    assert reasons_of(doubtful, unknown=False, thresholds={}) == ()


@pytest.mark.parametrize("preset", list(Preset))
def test_the_pipeline_tells_the_reasons_by_the_thresholds_of_its_bundle(preset):
    bundle = untrained_bundle()
    contact = contact_of(noisy(seen_hull(Pose(0.7, (45.0, 10.0, -3.0), CATALOGUE[1].box))))
    points = len(contact.points_level)
    assert Reason.FEW_POINTS not in Pipeline(bundle).run(contact, Options(preset)).reasons
    table = {"few_points": points + 1, "bow_below": 1.0, "end_on_deg": 90.0, "occluded_above": 0.0}
    doubting = Pipeline(replace(bundle, parameters={**bundle.parameters, "reasons": table}))
    said = doubting.run(contact, Options(preset))
    assert {Reason.FEW_POINTS, Reason.END_ON, Reason.OCCLUDED, Reason.BOW_UNCERTAIN} <= set(said.reasons)
    assert (Reason.OUT_OF_CATALOGUE in said.reasons) == said.unknown


def test_stern_on_is_as_end_on_as_bow_on():
    pipeline = Pipeline(untrained_bundle())
    work = pipeline.begin(contact_of(noisy(seen_hull(Pose(0.1, (45.0, 0.0, -3.0), CATALOGUE[1].box)))), Options())
    for stage in pipeline.stages:
        stage.run(work)
    x, y, _ = work.pose.origin_level
    stern_on = Pose(math.atan2(y, x) + math.radians(3.0), work.pose.origin_level, work.pose.size)
    for heading in (stern_on, stern_on.turned(math.pi)):
        work.pose = heading
        assert measure(work).off_ends_deg == pytest.approx(3.0, abs=1e-3)
