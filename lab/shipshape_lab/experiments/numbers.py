"""From what the experiments left to flat numbers, `<set>.<quantity>.<system>.<slice>`; shares lie in [0, 1].

Clusters that the service refused count as wrong in every share; they have no part in medians and means.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from shipshape_lab import metrics
from shipshape_lab.experiments.predictions import Answers, Truth
from shipshape_lab.experiments.restoration_p import CLOUDS, SCORES
from shipshape_lab.experiments.systems import BEST, PAPER_POSE, RAW, SYSTEMS

DISTANCES = tuple(range(30, 111, 10))
ASPECT_EDGES = tuple(range(0, 181, 30))
BEYOND_M = 70.0
END_ON_DEG = 15.0
POSES = {BEST: BEST, "paper": PAPER_POSE}  # name in the keys -> system that it is read from
Numbers = dict[str, float]


def slices(range_m: np.ndarray, aspect_deg: np.ndarray) -> dict[str, np.ndarray]:
    """Masks of the clusters: all, beyond 70 m (80 to 110 m), each distance, bow-on, stern-on, each 30 degrees."""
    masks = {
        "overall": np.ones(len(range_m), np.bool_),
        "beyond_70m": range_m > BEYOND_M + 1.0,
        "bow_on": aspect_deg <= END_ON_DEG,
        "stern_on": aspect_deg >= 180.0 - END_ON_DEG,
    }
    masks |= {f"{distance}m": np.abs(range_m - distance) < 1.0 for distance in DISTANCES}
    bins = np.clip(np.digitize(aspect_deg, ASPECT_EDGES) - 1, 0, len(ASPECT_EDGES) - 2)
    masks |= {name: bins == i for i, name in enumerate(aspect_names())}
    return {name: mask for name, mask in masks.items() if mask.any()}


def aspect_names() -> list[str]:
    """Names of the 30-degree slices of aspect, bow-on first."""
    return [f"aspect_{low}_{high}" for low, high in pairwise(ASPECT_EDGES)]


def of_answers(name: str, truth: Truth, answers: Answers, catalogue: Sequence[str]) -> Numbers:
    """Accuracy, heading, box, calibration and rejection of every system on the set `name`."""
    masks = slices(truth.range_m, truth.aspect_deg)
    masks |= {vessel: truth.label == i for i, vessel in enumerate(catalogue) if i in truth.label}
    found: Numbers = {
        f"{name}.clusters": len(truth.label),
        f"{name}.refused": int((answers.vessel[SYSTEMS.index(BEST)] < 0).sum()),
    }
    for system in SYSTEMS:
        row = SYSTEMS.index(system)
        right = answers.vessel[row] == truth.label
        for part, mask in masks.items():
            found[f"{name}.accuracy.{system}.{part}"] = right[mask].mean()
        found |= {f"{name}.{key}": value for key, value in _confidence(system, right, answers).items()}
    for label, system in POSES.items():
        for key, value in _pose(truth, answers, SYSTEMS.index(system), masks):
            found[f"{name}.{key.format(label)}"] = value
    return found


def _confidence(system: str, right: np.ndarray, answers: Answers) -> Numbers:
    row = SYSTEMS.index(system)
    answered = answers.vessel[row] >= 0
    confidence = answers.probability[row][answered].astype(np.float64)
    found = {f"ece.{system}": metrics.calibration_error(confidence, right[answered])}
    if system in (BEST, RAW):  # the paper knows no "unknown"
        unknown = answers.unknown[row]
        found[f"unknown_share.{system}"] = unknown[answered].mean()
        found[f"accuracy_named.{system}.overall"] = (right & ~unknown).mean()
    return found


def _pose(truth: Truth, answers: Answers, row: int, masks: dict[str, np.ndarray]) -> Iterator[tuple[str, float]]:
    heading = answers.heading[row]
    error = metrics.heading_error_deg(heading, truth.heading)
    bow = metrics.bow_right(heading, truth.heading)
    center = np.linalg.norm(answers.center[row] - truth.center, axis=1)
    size = np.abs(answers.size[row] - truth.size)
    for part, mask in masks.items():
        end = "" if part == "overall" else f".{part}"
        yield f"heading.{{}}.median_deg{end}", np.nanmedian(error[mask])
        yield f"heading.{{}}.within_5deg{end}", (error[mask] <= 5.0).mean()
        yield f"heading.{{}}.within_10deg{end}", (error[mask] <= 10.0).mean()
        yield f"bow_stern.{{}}{end}", bow[mask].mean()
        yield f"center.{{}}.median_m{end}", np.nanmedian(center[mask])
    for axis, side in enumerate(("length", "beam", "height")):
        yield f"box.{{}}.{side}_median_error_m", np.nanmedian(size[:, axis])


def of_restoration(scores: np.ndarray, range_m: np.ndarray, aspect_deg: np.ndarray) -> Numbers:
    """Means of CD-L1 and CD-L2 (both x 1000), F-score@1% and number of points of every cloud."""
    scores = scores.astype(np.float64) * np.array([metrics.REPORTED_FACTOR] * 2 + [1.0, 1.0])
    found: Numbers = {"P.restoration.clusters": int(np.isfinite(scores[:, 0, 0]).sum())}
    for part, mask in slices(range_m, aspect_deg).items():
        end = "" if part == "overall" else f".{part}"
        means = np.nanmean(scores[mask], axis=0)
        for cloud, values in zip(CLOUDS, means, strict=True):
            for score, value in zip(SCORES, values, strict=True):
                found[f"P.{score}.{cloud}{end}"] = value
    return found


def of_pipeline_ms(measured: dict) -> Numbers:
    """Median and 95th percentile of the whole pipeline, and the median of each stage, by points of the cluster."""
    found: Numbers = {}
    for points, timing in measured["points"].items():
        found[f"pipeline_ms.best.{points}"] = timing["total"]["median"]
        found[f"pipeline_ms.best.{points}.p95"] = timing["total"]["p95"]
        found[f"pipeline_ms.best.{points}.processor"] = timing["processor"]["median"]
        for stage, times in timing["stages"].items():
            found[f"pipeline_ms.best.{points}.{stage}"] = times["median"]
    return found


def rounded(numbers: Numbers) -> Numbers:
    """Six significant digits, so that noise of the last bit does not show; what is not a number is left out."""
    return {
        key: value if isinstance(value, int) else float(f"{value:.6g}")
        for key, value in numbers.items()
        if np.isfinite(value)
    }
