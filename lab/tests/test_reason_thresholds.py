"""The thresholds of reason codes must be those that the answers were drawn with."""

import numpy as np
import pytest

from shipshape_lab.training.reason_thresholds import MUCH_HIDDEN, Judged, best_cut, reason_thresholds, trusted_from

COUNT = 20_000


@pytest.fixture(scope="module")
def judged():
    """Names fail under 30 points, lengths within 20 degrees of the ends, bows as their probability says."""
    rng = np.random.default_rng(2)
    points = rng.integers(10, 200, COUNT)
    angle = rng.uniform(0.0, 90.0, COUNT)
    bow = rng.uniform(0.5, 1.0, COUNT)
    hidden = np.where(rng.random(COUNT) < 0.2, rng.uniform(MUCH_HIDDEN, 0.6, COUNT), 0.0)
    return Judged(
        points=points,
        off_ends_deg=angle,
        missing_share=hidden + rng.uniform(0.0, 0.1, COUNT),
        bow_probability=bow,
        catalogue=rng.random(COUNT) < 0.7,
        named_right=rng.random(COUNT) < np.where(points < 30, 0.8, 0.99),
        bow_right=rng.random(COUNT) < bow,
        length_right=rng.random(COUNT) < np.where(angle < 20.0, 0.7, 0.9),
        hidden_share=hidden,
    )


def test_thresholds_lie_where_the_answers_turn(judged):
    found = reason_thresholds(judged)
    assert found["few_points"] == pytest.approx(30, abs=2)
    assert found["end_on_deg"] == pytest.approx(20.0, abs=2.0)
    assert found["bow_below"] == pytest.approx(0.95, abs=0.02)
    assert 0.1 <= found["occluded_above"] <= MUCH_HIDDEN


def test_what_is_outside_of_the_catalogue_does_not_count(judged):
    ruined = {
        name: np.where(judged.catalogue, getattr(judged, name), False)
        for name in ("named_right", "bow_right", "length_right")
    }
    spoilt = Judged(**{**judged.__dict__, **ruined})
    assert reason_thresholds(spoilt) == reason_thresholds(judged)


def test_a_set_that_does_not_say_what_was_hidden_fits_no_threshold_for_it(judged):
    silent = Judged(**{**judged.__dict__, "hidden_share": np.full(COUNT, np.nan)})
    assert "occluded_above" not in reason_thresholds(silent)


def test_equal_values_are_trusted_together():
    values = np.array([10, 10, 10, 10, 11, 11, 11, 11])
    right = np.array([1, 1, 1, 0, 1, 1, 1, 1], bool)
    assert trusted_from(values, right, 0.95) == 11
    assert trusted_from(values, right[::-1], 0.7) == 10


def test_where_nothing_is_trusted_the_threshold_is_the_largest_value():
    assert trusted_from(np.arange(5), np.zeros(5, bool), 0.95) == 4


def test_the_best_cut_separates_what_can_be_separated():
    values = np.array([0.1, 0.2, 0.5, 0.7, 0.8])
    assert 0.5 < best_cut(values, values > 0.6) < 0.7
    assert best_cut(values, np.zeros(5, bool)) == 1.0
