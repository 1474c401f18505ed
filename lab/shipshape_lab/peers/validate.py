"""How well trained a peer is, and its temperature: both from the validation set alone."""

import itertools
import time

import numpy as np
from scipy.optimize import minimize_scalar
from tqdm import tqdm

from shipshape.errors import Unprocessable
from shipshape.softmax import softmax
from shipshape.validation import ContactLimits, check_contact
from shipshape_lab.metrics import calibration_error
from shipshape_lab.peers.load import Logits
from shipshape_lab.training.examples import Examples

RANGES_M = (25, 75, 125, 200)


def validated(logits: Logits, validation: Examples, *, seed: int) -> tuple[float, dict]:
    """The temperature, and accuracies of the most probable class, "unknown" being one of them.

    The set is drawn once, as training draws (thinned, mirrored, sensor height told or not) and as the service's
    own calibration does; contacts that the service would refuse are left out.

    Returns:
        The temperature with the least negative log-likelihood; scores: clusters, accuracy, accuracy_FROM_TO by
        range in metres, ece (expected calibration error), cpu_ms (median CPU time of one cluster).
    """
    rng = np.random.default_rng(seed)
    answers, labels, ranges, spent = [], [], [], []
    for i in tqdm(validation.indices, desc="validate", mininterval=2.0):
        example = validation.drawn(int(i), rng)
        try:
            check_contact(example.contact, ContactLimits())
        except Unprocessable:
            continue
        started = time.process_time()
        answers.append(logits(example.contact))
        spent.append(time.process_time() - started)
        labels.append(example.label)
        ranges.append(validation.clusters.range_m[i])
    truth = np.array(labels)
    temperature = fitted_temperature(answers, truth)
    chances = _chances(answers, temperature)
    scores = _accuracies(chances.argmax(axis=1) == truth, np.array(ranges))
    scores["ece"] = round(calibration_error(chances.max(axis=1), chances.argmax(axis=1) == truth), 4)
    scores["cpu_ms"] = round(float(np.median(spent)) * 1e3, 2)
    return temperature, scores


def _chances(answers: list[np.ndarray], temperature: float) -> np.ndarray:
    return np.stack([softmax(rows / np.float32(temperature)).mean(axis=0) for rows in answers])


def fitted_temperature(answers: list[np.ndarray], truth: np.ndarray) -> float:
    """The temperature with the least negative log-likelihood of `truth` (n,), given n logits (k, classes)."""

    def loss(temperature: float) -> float:
        chances = _chances(answers, temperature)[np.arange(len(truth)), truth]
        return -float(np.log(np.maximum(chances, 1e-7)).mean())

    return float(minimize_scalar(loss, bounds=(0.2, 5.0), method="bounded", options={"maxiter": 20}).x)


def _accuracies(right: np.ndarray, ranges: np.ndarray) -> dict:
    scores = {"clusters": len(right), "accuracy": round(float(right.mean()), 4)}
    for low, high in itertools.pairwise(RANGES_M):
        here = (low <= ranges) & (ranges < high)
        scores[f"accuracy_{low}_{high}"] = round(float(right[here].mean()), 4)
    return scores
