"""From answers to flat numbers, `<set>.<quantity>.<system>.<slice>`; shares lie in [0, 1].

Clusters that the service refused count as wrong in every share; they have no part in medians and means.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from shipshape_lab import metrics
from shipshape_lab.experiments.predictions import Answers, Said, Truth
from shipshape_lab.experiments.systems import BEST, IMAGE_METHODS, PAPER_POSE

DISTANCES = tuple(range(30, 111, 10))
BANDS = ((30, 60), (60, 90), (90, 120), (120, 150), (150, 200))  # m, of sets that are not on the grid
ASPECT_EDGES = tuple(range(0, 181, 30))
BEYOND_M = 70.0
END_ON_DEG = 15.0
RELIABILITY_BINS = 15
POSES = {BEST: BEST, "paper": PAPER_POSE}  # name in the keys -> system that it is read from
Masks = dict[str, np.ndarray]
Numbers = dict[str, float]


def slices(range_m: np.ndarray, aspect_deg: np.ndarray) -> Masks:
    """Masks of the clusters: all, beyond 70 m (80 to 110 m), each distance, bow-on, stern-on, each 30 degrees."""
    masks = {"overall": np.ones(len(range_m), np.bool_), "beyond_70m": range_m > BEYOND_M + 1.0}
    masks |= {f"{distance}m": np.abs(range_m - distance) < 1.0 for distance in DISTANCES}
    masks |= aspect_slices(aspect_deg)
    return {name: mask for name, mask in masks.items() if mask.any()}


def aspect_slices(aspect_deg: np.ndarray) -> Masks:
    """Masks of the clusters by aspect: bow-on, stern-on, each 30 degrees."""
    bins = np.clip(np.digitize(aspect_deg, ASPECT_EDGES) - 1, 0, len(ASPECT_EDGES) - 2)
    ends = {"bow_on": aspect_deg <= END_ON_DEG, "stern_on": aspect_deg >= 180.0 - END_ON_DEG}
    return ends | {name: bins == i for i, name in enumerate(aspect_names())}


def band_slices(range_m: np.ndarray) -> Masks:
    """Masks of the clusters by band of distance."""
    return {f"{low}_{high}m": (range_m >= low) & (range_m < high) for low, high in BANDS}


def aspect_names() -> list[str]:
    """Names of the 30-degree slices of aspect, bow-on first."""
    return [f"aspect_{low}_{high}" for low, high in pairwise(ASPECT_EDGES)]


def of_answers(name: str, truth: Truth, answers: Answers, catalogue: Sequence[str]) -> Numbers:
    """Accuracy, calibration and pose of every system on a set whose clusters are all of the catalogue.

    Right is the most probable vessel, whether or not the system would rather call it unknown. On the paper grid
    the whole set is the slice `overall`; other sets have it under the bare name.
    """
    grid = name.startswith("P")
    masks = slices(truth.range_m, truth.aspect_deg)
    if not grid:
        masks = {"overall": masks["overall"], **band_slices(truth.range_m), **aspect_slices(truth.aspect_deg)}
    masks |= {vessel: truth.label == i for i, vessel in enumerate(catalogue)}
    masks = {part: mask for part, mask in masks.items() if mask.any()}
    found: Numbers = {f"{name}.clusters": len(truth.label), f"{name}.refused": refused(answers)}
    for system in answers.system.tolist():
        said = answers.of(system)
        right = said.vessel == truth.label
        for part, mask in masks.items():
            end = "" if part == "overall" and not grid else f".{part}"
            found[f"{name}.accuracy.{system}{end}"] = right[mask].mean()
        if system not in IMAGE_METHODS:  # the paper knows no "unknown"
            found[f"{name}.unknown_share.{system}"] = said.unknown[said.answered].mean()
            found[f"{name}.accuracy_named.{system}.overall"] = (right & ~said.unknown).mean()
    return found | of_confidence(name, truth, answers) | of_pose(name, truth, answers, masks)


def refused(answers: Answers) -> int:
    """How many clusters the service refused."""
    return int(np.count_nonzero(~answers.of(BEST).answered))


def of_confidence(name: str, truth: Truth, answers: Answers) -> Numbers:
    """Expected calibration error of every system, and the reliability of `best` in bins of its confidence.

    Confidence is the largest of the probabilities of all vessels and of "unknown"; right is whether that one is.
    """
    found: Numbers = {}
    for system in answers.system.tolist():
        said = answers.of(system)
        probabilities = said.probabilities[said.answered].astype(np.float64)
        confidence, right = probabilities.max(axis=1), probabilities.argmax(axis=1) == truth.label[said.answered]
        found[f"{name}.ece.{system}"] = metrics.calibration_error(confidence, right, RELIABILITY_BINS)
        if system == BEST:
            place = np.minimum((confidence * RELIABILITY_BINS).astype(int), RELIABILITY_BINS - 1)
            for i in np.unique(place):
                key, inside = f"{name}.reliability.{system}.bin_{i:02d}", place == i
                found[f"{key}.said"] = confidence[inside].mean()
                found[f"{key}.right"] = right[inside].mean()
                found[f"{key}.share"] = inside.mean()
    return found


def of_pose(name: str, truth: Truth, answers: Answers, masks: Masks) -> Numbers:
    """Heading, bow, centre and box of `best` and, where it was asked, of preset `paper`."""
    found: Numbers = {}
    for label, system in POSES.items():
        if system in answers.system:
            for key, value in _pose(truth, answers.of(system), masks):
                found[f"{name}.{key.format(label)}"] = value
    return found


def _pose(truth: Truth, said: Said, masks: Masks) -> Iterator[tuple[str, float]]:
    error = metrics.heading_error_deg(said.heading, truth.heading)
    bow = metrics.bow_right(said.heading, truth.heading)
    center = np.linalg.norm(said.center - truth.center, axis=1)
    in_std = error / np.degrees(said.heading_std)
    for part, mask in masks.items():
        end = "" if part == "overall" else f".{part}"
        if not np.isfinite(error[mask]).any():
            continue
        yield f"heading.{{}}.median_deg{end}", np.nanmedian(error[mask])
        yield f"heading.{{}}.within_5deg{end}", (error[mask] <= 5.0).mean()
        yield f"heading.{{}}.within_10deg{end}", (error[mask] <= 10.0).mean()
        yield f"heading.{{}}.within_1std{end}", (in_std[mask] <= 1.0).mean()
        yield f"heading.{{}}.within_2std{end}", (in_std[mask] <= 2.0).mean()
        yield f"bow_stern.{{}}{end}", bow[mask].mean()
        yield f"center.{{}}.median_m{end}", np.nanmedian(center[mask])
    for axis, side in enumerate(("length", "beam", "height")):
        yield f"box.{{}}.{side}_median_error_m", np.nanmedian(np.abs(said.size - truth.size)[:, axis])


def of_pipeline_ms(measured: dict) -> Numbers:
    """Median and 95th percentile of the whole pipeline, and the median of each stage, by points of the cluster."""
    found: Numbers = {}
    for points, timing in measured.items():
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
