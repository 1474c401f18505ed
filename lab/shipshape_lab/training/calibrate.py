"""Fit what a bundle measures rather than trains, on the validation set alone.

Fitted: the prior's temperature; the paper's threshold of grey, sharpness of part votes and spread of heading; the
best preset's spread of heading, temperature of the bow, weights of the evidence and threshold of "unknown"; and
from which value on each reason code is given (`reason_thresholds`). Whatever speaks of a pose is fitted on the
catalogue's vessels alone: what a stray thing's heading would be means nothing.
"""

import copy
import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from tqdm import tqdm

from shipshape import frames, raster
from shipshape.bundle import Bundle
from shipshape.pipeline import Pipeline
from shipshape.reasons import Measures, measure
from shipshape.softmax import softmax
from shipshape.stages import bow_stern, classification, keypoints, prior, projection, spd2
from shipshape.stages.keypoints import KeypointParams
from shipshape.types import ImageMethod, Options, Preset
from shipshape_lab.training.examples import Example, Examples, is_accepted
from shipshape_lab.training.partial import run_until
from shipshape_lab.training.reason_thresholds import Judged, reason_thresholds

ONE_STD = 0.683  # share of a normal distribution within one standard deviation
LENGTH_RIGHT = 0.1  # a length is right within this share of the true one
KNOWN_KEPT = 0.995  # share of catalogue vessels that the threshold of "unknown" must leave known


@dataclass(frozen=True)
class BestEvidence:
    """What preset `best` saw of one validation contact."""

    turn_error: float  # rad, modulo pi
    heading_std: float  # rad, as the network says it
    flip_logits: np.ndarray  # (2,): of the aligned looks and of the first look
    flipped: bool  # whether the bow truly pointed the other way
    witnesses: np.ndarray  # (4, classes) probabilities in the order that fusion weighs them
    label: int
    measures: Measures  # its bow probability is not calibrated yet
    length_ratio: float  # of the length found to the true one


def calibrated(bundle: Bundle, validation: Examples, *, seed: int) -> tuple[dict, dict]:
    """The bundle's parameters, fitted, and the scores of preset `best` on the same set."""
    parameters = copy.deepcopy(dict(bundle.parameters))
    rng = np.random.default_rng(seed)
    drawn = [(int(i), validation.drawn(int(i), rng)) for i in validation.indices]
    accepted = [(i, example) for i, example in drawn if is_accepted(example.contact)]
    contacts = [example for _, example in accepted]
    hidden_share = validation.clusters.hidden_share[[i for i, _ in accepted]]
    catalogue = [example for example in contacts if example.label < len(bundle.catalogue)]
    pipeline = Pipeline(bundle)
    parameters["common"]["prior_temperature"] = prior_temperature(pipeline, contacts)
    parameters["paper"].update(paper_parameters(pipeline, catalogue))
    pipeline = Pipeline(_with(bundle, parameters))
    seen = [_best_evidence(pipeline, example) for example in _bar(contacts, "best")]
    parameters["best"].update(best_parameters(seen))
    weights = parameters["best"]["fusion_weights"]
    parameters["common"]["unknown_above"] = unknown_threshold(seen, weights)
    parameters["reasons"] = reason_thresholds(judged(seen, parameters, hidden_share))
    return parameters, validation_scores(seen, parameters["best"])


def _with(bundle: Bundle, parameters: dict) -> Bundle:
    return Bundle(bundle.name, bundle.digest, bundle.catalogue, bundle.models, parameters, {}, {})


def _bar(items: list, title: str) -> tqdm:
    return tqdm(items, desc=f"calibrate {title}", mininterval=2.0)


def prior_temperature(pipeline: Pipeline, contacts: list[Example]) -> float:
    """Temperature that minimises the negative log-likelihood of the prior's mean confidence."""
    model, radius = pipeline.bundle.models["prior"], pipeline.bundle.parameters["common"]["spd2_radius"]
    images = []
    for example in _bar(contacts, "prior"):
        points = pipeline.begin(example.contact, Options()).points_sight
        images.append(spd2.describe(points, keypoints.select_keypoints(points, KeypointParams()), radius))

    def loss(temperature: float) -> float:
        chances = [
            prior.estimate_prior(image, model, temperature=temperature)[example.label]
            for image, example in zip(images, contacts, strict=True)
        ]
        return -float(np.log(np.maximum(chances, 1e-7)).mean())

    return float(minimize_scalar(loss, bounds=(0.3, 5.0), method="bounded", options={"maxiter": 12}).x)


def paper_parameters(pipeline: Pipeline, catalogue: list[Example]) -> dict:
    """Spread of the heading (1.4826 MAD), sharpness of part votes, and the grey threshold of best overlap."""
    errors, votes, ahead = [], [], []
    for example in _bar(catalogue, "paper"):
        work = run_until(pipeline, example.contact, Options(Preset.PAPER), "heading")
        errors.append(frames.wrap_half_turn(work.pose.heading - example.pose.heading))
        votes.append(_part_votes(pipeline, work))
        ahead.append(math.cos(work.pose.heading - example.pose.heading) > 0)
    return {
        "heading_std": float(1.4826 * np.median(np.abs(errors))),
        "part_sharpness": _sharpness(np.array(votes), np.array(ahead)),
        "empty_below": _empty_below(pipeline, catalogue[:: max(len(catalogue) // 300, 1)]),
    }


def _part_votes(pipeline: Pipeline, work) -> float:
    parameters = pipeline.bundle.parameters
    points = work.pose.to_vessel(work.contact.points_level)
    parts = keypoints.select_keypoints(points, KeypointParams(limit=parameters["paper"]["part_keypoints"]))
    images = spd2.describe(points, parts, parameters["common"]["spd2_radius"])
    (logits,) = pipeline.bundle.models["parts"].run(images=images)
    return bow_stern.part_votes(parts[:, 0], softmax(logits), work.pose.size.length)


def _sharpness(votes: np.ndarray, ahead: np.ndarray) -> float:
    signs = np.where(ahead, 1.0, -1.0) * votes
    return float(
        minimize_scalar(lambda k: np.logaddexp(0, -k * signs).mean(), bounds=(0.01, 50), method="bounded").x
    )


def _empty_below(pipeline: Pipeline, catalogue: list[Example]) -> float:
    """Grey threshold with the best mean overlap (IoU) of filled pixels over the four image methods."""
    thresholds = np.linspace(0.02, 0.5, 13)
    overlaps = np.zeros(len(thresholds))
    for method in ImageMethod:
        model = pipeline.bundle.models[f"inpainting_{method}"]
        for example in _bar(catalogue, f"grey {method}"):
            work = run_until(pipeline, example.contact, Options(Preset.PAPER, method), "projection")
            layers = projection.project(example.surface_level, work.pose, work.frame)
            truth = raster.to_grey(layers.count > 0, layers.top, work.frame).transpose(2, 0, 1) > 0
            (filled,) = model.run(image=work.before.transpose(2, 0, 1)[None].astype(np.float32) / 255)
            for k, threshold in enumerate(thresholds):
                found = filled[0] >= threshold
                overlaps[k] += (found & truth).sum() / max((found | truth).sum(), 1)
    return float(thresholds[np.argmax(overlaps)])


def _best_evidence(pipeline: Pipeline, example: Example) -> BestEvidence:
    work = run_until(pipeline, example.contact, Options(Preset.BEST), "spd2")
    restored = classification.mean_confidence(work.images, pipeline.bundle.models["spd2"])
    looks = (work.look.class_logits, work.bottleneck)
    return BestEvidence(
        turn_error=frames.wrap_half_turn(work.look.pose.heading - example.pose.heading),
        heading_std=work.look.heading_std,
        flip_logits=np.array([work.look.flip_logit, work.first.flip_logit(work.look.pose)]),
        flipped=math.cos(work.look.pose.heading - example.pose.heading) < 0,
        witnesses=np.stack([work.prior, *map(softmax, looks), restored]),
        label=example.label,
        measures=measure(work),
        length_ratio=work.pose.size.length / example.pose.size.length,
    )


def best_parameters(seen: list[BestEvidence]) -> dict:
    """Parameters of preset `best`."""
    known = [e for e in seen if e.label < len(e.witnesses[0]) - 1]
    scale, power = heading_spread(np.abs([e.turn_error for e in known]), np.array([e.heading_std for e in known]))
    return {
        "heading_std_scale": scale,
        "heading_std_power": power,
        "bow_weights": bow_weights(known),
        "fusion_weights": _fusion_weights(_log_witnesses(seen), _labels(seen)).tolist(),
    }


def bow_weights(seen: list[BestEvidence]) -> list[float]:
    """Non-negative weights of the looks' log-odds under which the true bow is most likely."""
    signs = np.array([e.flip_logits * (1 if e.flipped else -1) for e in seen])
    found = minimize(
        lambda weights: np.logaddexp(0, -signs @ weights).mean(),
        [0.5, 0.5],
        bounds=[(0.0, 5.0)] * 2,
        method="L-BFGS-B",
    )
    return [float(weight) for weight in found.x]


def heading_spread(errors: np.ndarray, said: np.ndarray) -> tuple[float, float]:
    """Scale and power of scale * said ** power, under which ONE_STD of the errors lie however large `said` is.

    Quantile regression of log error on log said, both in radians: one factor for all would leave more of the
    errors of near vessels, and fewer of far ones', within one standard deviation.
    """
    logs, middle = np.log(said), float(np.log(said).mean())
    targets = np.log(np.maximum(errors, 1e-6))

    def loss(line: np.ndarray) -> float:
        miss = targets - line[0] - line[1] * (logs - middle)
        return float(np.maximum(ONE_STD * miss, (ONE_STD - 1.0) * miss).mean())

    start = [np.quantile(targets - logs, ONE_STD) + middle, 1.0]
    level, power = minimize(loss, start, method="Nelder-Mead").x
    return math.exp(level - power * middle), float(power)


def judged(seen: list[BestEvidence], parameters: dict, hidden_share: np.ndarray) -> Judged:
    """The answers that the fitted parameters give, beside the truth."""
    fused, labels = _fused(seen, parameters["best"]["fusion_weights"]), _labels(seen)
    known = fused[:, :-1].max(axis=1)
    unknown = fused[:, -1] > np.minimum(known, parameters["common"]["unknown_above"])
    named = np.where(unknown, fused.shape[1] - 1, fused[:, :-1].argmax(axis=1))
    flips = _flips(seen, parameters["best"]["bow_weights"])
    return Judged(
        points=np.array([e.measures.points for e in seen]),
        off_ends_deg=np.array([e.measures.off_ends_deg for e in seen]),
        missing_share=np.array([e.measures.missing_share for e in seen]),
        bow_probability=1.0 / (1.0 + np.exp(-np.minimum(np.abs(flips), 30.0))),
        catalogue=labels < fused.shape[1] - 1,
        named_right=named == labels,
        bow_right=(flips > 0) == [e.flipped for e in seen],
        length_right=np.abs(np.array([e.length_ratio for e in seen]) - 1.0) <= LENGTH_RIGHT,
        hidden_share=hidden_share,
    )


def unknown_threshold(seen: list[BestEvidence], weights: list[float]) -> float:
    """Probability of "unknown" that all but 1 - KNOWN_KEPT of the catalogue's own vessels stay under."""
    fused, labels = _fused(seen, weights), _labels(seen)
    known = fused[labels < fused.shape[1] - 1, -1]
    return float(np.clip(np.quantile(known, KNOWN_KEPT), 0.05, 0.95))


def validation_scores(seen: list[BestEvidence], best: dict) -> dict:
    """What preset `best` reaches on the set it was calibrated on: a sanity check, not evidence."""
    fused, labels = _fused(seen, best["fusion_weights"]), _labels(seen)
    catalogue = labels < fused.shape[1] - 1
    errors = np.degrees(np.abs([e.turn_error for e in seen]))[catalogue]
    bow = ((_flips(seen, best["bow_weights"]) > 0) == [e.flipped for e in seen])[catalogue]
    return {
        "validation": {
            "clusters": int(np.count_nonzero(catalogue)),
            "accuracy": round(float((fused[catalogue, :-1].argmax(axis=1) == labels[catalogue]).mean()), 4),
            "heading_within_5deg": round(float((errors <= 5.0).mean()), 4),
            "bow_stern": round(float(bow.mean()), 4),
        }
    }


def _fused(seen: list[BestEvidence], weights: list[float]) -> np.ndarray:
    return softmax((np.asarray(weights, np.float32)[None, :, None] * _log_witnesses(seen)).sum(axis=1))


def _log_witnesses(seen: list[BestEvidence]) -> np.ndarray:
    return np.log(np.maximum(np.stack([e.witnesses for e in seen]), np.float32(1e-7)))


def _flips(seen: list[BestEvidence], weights: list[float]) -> np.ndarray:
    return np.array([e.flip_logits for e in seen]) @ weights


def _labels(seen: list[BestEvidence]) -> np.ndarray:
    return np.array([e.label for e in seen])


def _fusion_weights(logs: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Non-negative weights of the log-linear pool with the least negative log-likelihood."""

    def loss(weights: np.ndarray) -> float:
        scores = (weights[None, :, None] * logs).sum(axis=1)
        scores -= scores.max(axis=1, keepdims=True)
        chance = scores[np.arange(len(labels)), labels] - np.log(np.exp(scores).sum(axis=1))
        return -float(chance.mean())

    found = minimize(loss, np.full(logs.shape[1], 0.3), bounds=[(0.0, 3.0)] * logs.shape[1], method="L-BFGS-B")
    return found.x
