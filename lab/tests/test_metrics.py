import numpy as np
import pytest
from numpy.testing import assert_allclose

from shipshape_lab import metrics


@pytest.fixture
def clouds():
    rng = np.random.default_rng(7)
    return rng.normal(0.0, 4.0, (60, 3)), rng.normal(0.5, 4.0, (90, 3))


def test_chamfer_distances_and_f_score_equal_brute_force(clouds):
    prediction, truth = clouds
    distances = np.linalg.norm(prediction[:, None] - truth[None], axis=2) / 20.0
    nearest = metrics.CompleteSurface(truth, extent=20.0).nearest(prediction)
    to_truth, to_prediction = distances.min(axis=1), distances.min(axis=0)
    assert_allclose(metrics.chamfer_l1(nearest), (to_truth.mean() + to_prediction.mean()) / 2)
    assert_allclose(metrics.chamfer_l2(nearest), (to_truth**2).mean() + (to_prediction**2).mean())
    precision, recall = (to_truth < 0.1).mean(), (to_prediction < 0.1).mean()
    assert_allclose(metrics.f_score(nearest, 0.1), 2 / (1 / precision + 1 / recall))


def test_a_shifted_grid_is_off_by_its_shift():
    grid = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), axis=-1).reshape(-1, 3)
    nearest = metrics.CompleteSurface(grid, extent=4.0).nearest(grid + np.array([0.2, 0.0, 0.0]))
    assert_allclose(metrics.chamfer_l1(nearest), 0.05)
    assert_allclose(metrics.chamfer_l2(nearest), 2 * 0.05**2)
    assert metrics.f_score(nearest, 0.051) == 1.0
    assert metrics.f_score(nearest, 0.049) == 0.0


def test_half_of_the_surface_has_perfect_precision_and_half_the_recall():
    truth = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    nearest = metrics.CompleteSurface(truth, extent=1.0).nearest(truth[:1])
    assert_allclose(metrics.f_score(nearest), 2 / 3)
    assert_allclose(metrics.chamfer_l1(nearest), 0.25)
    assert_allclose(metrics.chamfer_l2(nearest), 0.5)


def test_metrics_do_not_depend_on_the_unit(clouds):
    prediction, truth = clouds
    metres = metrics.CompleteSurface(truth, extent=20.0).nearest(prediction)
    feet = metrics.CompleteSurface(truth * 3.28, extent=20.0 * 3.28).nearest(prediction * 3.28)
    assert_allclose(metrics.chamfer_l2(metres), metrics.chamfer_l2(feet))


def test_an_empty_prediction_has_no_distance():
    with pytest.raises(ValueError, match="got 0"):
        metrics.CompleteSurface(np.zeros((3, 3)), extent=1.0).nearest(np.zeros((0, 3)))


@pytest.mark.parametrize(
    ("estimated", "true", "error"),
    [(10, 12, 2), (1, 179, 2), (-89, 90, 1), (0, 180, 0), (181, 0, 1), (0, 90, 90), (-170, 15, 5)],
)
def test_heading_error_counts_bow_and_stern_as_the_same(estimated, true, error):
    assert_allclose(metrics.heading_error_deg(np.radians(estimated), np.radians(true)), error, atol=1e-9)


def test_bow_is_right_within_a_quarter_turn():
    estimated = np.radians([0.0, 89.0, 91.0, 180.0, -350.0, np.nan])
    assert metrics.bow_right(estimated, np.zeros(6)).tolist() == [True, True, False, False, True, False]


def test_calibration_error_of_answers_as_good_as_they_claim_is_zero():
    confidence = np.repeat([0.25, 0.75], 100)
    right = np.concatenate([np.arange(100) < 25, np.arange(100) < 75])
    assert_allclose(metrics.calibration_error(confidence, right), 0.0, atol=1e-12)
    assert_allclose(metrics.calibration_error(np.ones(10), np.zeros(10, bool)), 1.0)
    assert_allclose(metrics.calibration_error(np.array([0.9, 0.9]), np.array([True, False])), 0.4)
