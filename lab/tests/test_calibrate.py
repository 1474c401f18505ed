"""What calibration fits must recover what the evidence was drawn with."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

from shipshape.reasons import Measures
from shipshape.softmax import softmax
from shipshape_lab.training import train_all
from shipshape_lab.training.calibrate import (
    KNOWN_KEPT,
    BestEvidence,
    best_parameters,
    heading_spread,
    judged,
    unknown_threshold,
    validation_scores,
)

CLASSES = 4  # three vessels and "unknown"
ONLY_THE_FIRST = [1.0, 0.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def seen():
    """Evidence whose spread, bow logits and witnesses are known by construction."""
    rng = np.random.default_rng(5)
    evidence = []
    for _ in range(4000):
        label = int(rng.integers(CLASSES))
        logits = rng.normal(0.0, 1.0, CLASSES) + 3.0 * (np.arange(CLASSES) == label)
        noise = rng.normal(0.0, 1.0, CLASSES)
        true_logit = rng.normal(0.0, 3.0)
        said = float(rng.uniform(0.01, 0.05))
        evidence.append(
            BestEvidence(
                turn_error=float(rng.normal(0.0, 2.0 * said)),
                heading_std=said,  # half of what it is
                flip_logits=np.array([3.0 * true_logit, rng.normal()]),  # three times too sure, and a guess
                flipped=bool(rng.random() < 1 / (1 + np.exp(-true_logit))),
                witnesses=softmax(np.stack([logits, noise, noise, noise]).astype(np.float32)),
                label=label,
                measures=Measures(50, 60.0, 0.1, 0.9),
                length_ratio=float(rng.choice([0.95, 1.2])),
            )
        )
    return evidence


def test_spread_and_weights_undo_too_much_confidence(seen):
    found = best_parameters(seen)
    assert found["heading_std_power"] == pytest.approx(1.0, abs=0.1)
    assert found["heading_std_scale"] * 0.03 ** found["heading_std_power"] == pytest.approx(0.06, rel=0.05)
    knows, guesses = found["bow_weights"]
    assert knows == pytest.approx(1 / 3, rel=0.15)
    assert guesses < 0.1


def test_the_spread_follows_errors_that_grow_faster_than_what_is_said():
    rng = np.random.default_rng(3)
    said = np.exp(rng.uniform(np.log(0.005), np.log(0.1), 20_000))
    scale, power = heading_spread(np.abs(rng.normal(0.0, 4.0 * said**1.3)), said)
    assert (scale, power) == (pytest.approx(4.0, rel=0.1), pytest.approx(1.3, abs=0.03))


def test_what_no_vessel_of_the_catalogue_is_has_no_part_in_the_pose(seen):
    stray = [replace(e, turn_error=1.5, flipped=not e.flipped) for e in seen if e.label == CLASSES - 1]
    vessels = [e for e in seen if e.label < CLASSES - 1]
    found, alone = best_parameters(vessels + stray), best_parameters(vessels)
    for name in ("heading_std_scale", "heading_std_power", "bow_weights"):
        assert found[name] == alone[name]


def test_answers_are_judged_as_the_service_would_give_them(seen):
    parameters = {
        "common": {"unknown_above": 0.5},
        "best": {"fusion_weights": ONLY_THE_FIRST, "bow_weights": [1 / 3, 0.0]},
    }
    found = judged(seen, parameters, np.full(len(seen), np.nan))
    for e, right, certainty in list(zip(seen, found.named_right, found.bow_probability, strict=True))[:200]:
        *known, unknown = e.witnesses[0]
        said = CLASSES - 1 if unknown > min(max(known), 0.5) else int(np.argmax(known))
        assert right == (said == e.label)
        assert certainty == pytest.approx(max(1 / (1 + np.exp(s * e.flip_logits[0] / 3.0)) for s in (1, -1)))
    np.testing.assert_array_equal(found.length_right, [e.length_ratio == 0.95 for e in seen])
    assert np.mean(found.bow_probability) == pytest.approx(np.mean(found.bow_right), abs=0.02)


def test_a_witness_that_knows_outweighs_those_that_guess(seen):
    knows, *guess = best_parameters(seen)["fusion_weights"]
    assert knows > 1.0
    assert max(guess) < 0.3


def test_the_threshold_of_unknown_keeps_the_catalogue_known(seen):
    threshold = unknown_threshold(seen, ONLY_THE_FIRST)
    known = [e.witnesses[0, -1] for e in seen if e.label < CLASSES - 1]
    assert np.mean(np.array(known) <= threshold) == pytest.approx(KNOWN_KEPT, abs=0.002)


def test_scores_count_catalogue_vessels_alone(seen):
    scores = validation_scores(seen, {"fusion_weights": ONLY_THE_FIRST, "bow_weights": [1.0, 0.0]})["validation"]
    catalogue = [e for e in seen if e.label < CLASSES - 1]
    assert scores["clusters"] == len(catalogue)
    right = np.mean([e.witnesses[0, :-1].argmax() == e.label for e in catalogue])
    assert scores["accuracy"] == pytest.approx(right, abs=1e-3)


def test_training_all_skips_what_is_there_and_names_every_network(tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr(train_all, "_run", lambda module, arguments, work, name: started.append(name))
    (tmp_path / "default/bundle").mkdir(parents=True)
    (tmp_path / "default/bundle/points.onnx").touch()
    steps = [step for wave in train_all.WAVES for step in wave]
    for step in steps:
        train_all.train_step(step, tmp_path)
    assert "points" not in started
    assert len(started) == len(steps) - 1
    files = {train_all.network_file(step) for step in steps}
    assert len(files) == len(steps) == 14
