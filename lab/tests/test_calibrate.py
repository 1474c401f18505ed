"""What calibration fits must recover what the evidence was drawn with."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

from shipshape.softmax import softmax
from shipshape_lab.training import train_all
from shipshape_lab.training.calibrate import (
    KNOWN_KEPT,
    BestEvidence,
    best_parameters,
    unknown_threshold,
    validation_scores,
)

CLASSES = 4  # three vessels and "unknown"


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
        evidence.append(
            BestEvidence(
                turn_error=float(rng.normal(0.0, 0.04)),
                heading_std=0.02,  # said to be half of what it is
                flip_logit=3.0 * true_logit,  # three times too sure
                flipped=bool(rng.random() < 1 / (1 + np.exp(-true_logit))),
                witnesses=softmax(np.stack([logits, noise, noise, noise]).astype(np.float32)),
                label=label,
            )
        )
    return evidence


def test_spread_and_temperature_undo_too_much_confidence(seen):
    found = best_parameters(seen)
    assert found["heading_std_scale"] == pytest.approx(2.0, rel=0.1)
    assert found["bow_temperature"] == pytest.approx(3.0, rel=0.15)


def test_a_witness_that_knows_outweighs_those_that_guess(seen):
    knows, *guess = best_parameters(seen)["fusion_weights"]
    assert knows > 1.0
    assert max(guess) < 0.3


def test_the_threshold_of_unknown_keeps_the_catalogue_known(seen):
    weights = [1.0, 0.0, 0.0, 0.0]
    threshold = unknown_threshold(seen, weights)
    known = [e.witnesses[0, -1] for e in seen if e.label < CLASSES - 1]
    assert np.mean(np.array(known) <= threshold) == pytest.approx(KNOWN_KEPT, abs=0.002)


def test_scores_count_catalogue_vessels_alone(seen):
    scores = validation_scores(seen, [1.0, 0.0, 0.0, 0.0])["validation"]
    catalogue = [e for e in seen if e.label < CLASSES - 1]
    assert scores["clusters"] == len(catalogue)
    right = np.mean([e.witnesses[0, :-1].argmax() == e.label for e in catalogue])
    assert scores["accuracy"] == pytest.approx(right, abs=1e-3)


def test_training_all_skips_what_is_there_and_names_every_network(tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr(train_all, "_run", lambda module, arguments, work, name: started.append(name))
    (tmp_path / "default/bundle").mkdir(parents=True)
    (tmp_path / "default/bundle/sight.onnx").touch()
    steps = [step for wave in train_all.WAVES for step in wave]
    for step in steps:
        train_all.train_step(step, tmp_path)
    assert "sight" not in started
    assert len(started) == len(steps) - 1
    files = {train_all.network_file(step) for step in steps}
    assert len(files) == len(steps) == 14
