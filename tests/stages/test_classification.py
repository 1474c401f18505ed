"""From logits to probabilities: the prior, the mean of confidences and the pool of witnesses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import special

from builders import constant, properties
from shipshape.softmax import softmax
from shipshape.stages import prior
from shipshape.stages.classification import fuse, mean_confidence, rule_out_too_long

LOGITS = arrays(np.float32, st.tuples(st.integers(1, 4), st.just(5)), elements=st.floats(-80, 80, width=32))
SEEDS = st.integers(0, 2**32 - 1)


def images(count: int) -> np.ndarray:
    return np.zeros((count, 5, 16, 32), np.float32)


def certainties(seed: int, count: int = 3, classes: int = 5) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).dirichlet(np.full(classes, 0.7), count).astype(np.float32))


@properties()
@given(LOGITS)
def test_softmax_is_scipys(logits: np.ndarray) -> None:
    np.testing.assert_allclose(softmax(logits), special.softmax(logits, axis=-1), atol=1e-6)


@properties()
@given(LOGITS)
def test_confidence_is_averaged_over_keypoints_and_sums_to_1(logits: np.ndarray) -> None:
    confidence = mean_confidence(images(len(logits)), constant(logits))

    expected = special.softmax(logits.astype(np.float64), axis=1).mean(axis=0)
    assert confidence.dtype == np.float32
    assert confidence.sum() == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(confidence, expected, atol=1e-5)


@properties()
@given(LOGITS, st.floats(0.2, 5.0))
def test_the_prior_is_averaged_over_keypoints_and_sums_to_1(logits: np.ndarray, temperature: float) -> None:
    probabilities = prior.estimate_prior(images(len(logits)), constant(logits), temperature=temperature)

    expected = special.softmax(logits.astype(np.float64) / temperature, axis=1).mean(axis=0)
    assert probabilities.dtype == np.float32
    assert probabilities.sum() == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(probabilities, expected, atol=1e-5)


def test_confidences_are_averaged_and_not_logits() -> None:
    logits = [[100.0, 0.0], [0.0, 1.0]]

    confidence = mean_confidence(images(2), constant(logits))

    np.testing.assert_allclose(
        confidence, [(1 + 1 / (1 + math.e)) / 2, (0 + math.e / (1 + math.e)) / 2], atol=1e-5
    )


@properties()
@given(SEEDS)
def test_a_witness_with_all_the_weight_is_believed(seed: int) -> None:
    first, second, _ = certainties(seed)

    np.testing.assert_allclose(fuse([first, second], [1.0, 0.0]), first, atol=1e-5)
    np.testing.assert_allclose(fuse([first, second], [0.0, 1.0]), second, atol=1e-5)


@properties()
@given(SEEDS)
def test_names_of_classes_do_not_matter(seed: int) -> None:
    evidence, weights = certainties(seed), [0.5, 0.2, 1.1]
    order = np.random.default_rng(seed).permutation(5)

    fused = fuse(evidence, weights)

    assert fused.sum() == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(fuse([p[order] for p in evidence], weights), fused[order], atol=1e-6)


@properties()
@given(SEEDS)
def test_the_pool_is_the_weighted_product(seed: int) -> None:
    evidence, weights = certainties(seed), [0.5, 0.2, 1.1]

    product = np.prod(
        [np.maximum(p.astype(np.float64), 1e-7) ** w for p, w in zip(evidence, weights, strict=True)], 0
    )

    np.testing.assert_allclose(fuse(evidence, weights), product / product.sum(), atol=1e-5)


def test_a_witness_that_rules_a_class_out_does_not_break_the_pool() -> None:
    fused = fuse([np.float32([0.0, 1.0]), np.float32([1.0, 0.0])], [1.0, 1.0])

    np.testing.assert_allclose(fused, [0.5, 0.5], atol=1e-5)


def test_each_witness_needs_its_weight() -> None:
    with pytest.raises(ValueError, match=r"."):
        fuse(certainties(1), [1.0, 1.0])


def test_what_measures_longer_than_every_vessel_is_unknown() -> None:
    probabilities = np.array([0.7, 0.2, 0.1], np.float32)
    np.testing.assert_array_equal(rule_out_too_long(probabilities, 34.0, longest=27.5), probabilities)
    doubted = rule_out_too_long(probabilities, 35.0, longest=27.5)
    assert doubted.sum() == pytest.approx(1.0)
    assert doubted[-1] > 0.99
    assert doubted[0] > doubted[1] > 0  # which it is most like is still told
