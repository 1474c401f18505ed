"""The numbers of set H: ten types, five of them in the catalogue, in sea, behind occluders, far off.

Right is the *decision*: the vessel, or "unknown" for what is not in the catalogue. `best` decides as the service
does, by its flag `unknown`; every other system by the most probable of the vessels and "unknown", which makes the
fewest errors if its probabilities are calibrated. The paper's method has no "unknown", so half of H is beyond it;
`accuracy_known` compares what it can do.

*Reach* is the range up to which the decision is right for at least 95 % of the clusters in every window of 30 m:
the centre of the last window, going out metre by metre, before the first one under 95 %. A system that is under
95 % in the nearest window reaches 30 m, where the set begins; one that never falls under it reaches 200 m.
"""

from collections.abc import Sequence

import numpy as np

from shipshape_lab.experiments import numbers
from shipshape_lab.experiments.numbers import Masks, Numbers
from shipshape_lab.experiments.predictions import Answers, Truth
from shipshape_lab.experiments.systems import BEST
from shipshape_lab.simulator.clusters import OCCLUDED_FROM

NEAREST_M, FARTHEST_M = 30, 200
WINDOW_M = 30.0
LEAST_ACCURACY = 0.95
CENTRES_M = range(NEAREST_M + 15, FARTHEST_M - 15 + 1)
SHOWN_CENTRES_M = CENTRES_M[::5]  # of the curve that is kept for the figure
UNKNOWN = "unknown"
POINT_BANDS = ((10, 20), (20, 40), (40, 80), (80, None))
POINTS = tuple(f"{low}_{high - 1}_points" if high else f"{low}_points_up" for low, high in POINT_BANDS)


def of_answers(truth: Truth, answers: Answers, catalogue: Sequence[str]) -> Numbers:
    """Errors, reach, confusion, calibration and pose of every system on H."""
    masks = slices(truth, len(catalogue))
    known = truth.label < len(catalogue)
    found: Numbers = {"H.clusters": len(truth.label), "H.refused": numbers.refused(answers)}
    found |= {f"H.clusters.{part}": int(mask.sum()) for part, mask in masks.items() if part != "overall"}
    wrong = {system: answers.of(system).decision != truth.label for system in answers.system.tolist()}
    found |= {f"H.error_shared.{s}": (wrong[BEST] & wrong[s]).mean() for s in wrong if s != BEST}
    for system, misses in wrong.items():
        said, right = answers.of(system), ~misses
        for part, mask in masks.items():
            found[f"H.error.{system}{'' if part == 'overall' else f'.{part}'}"] = 1.0 - right[mask].mean()
        found[f"H.reach_m.{system}"] = reach_m(truth.range_m, right)
        windows = window_accuracy(truth.range_m, right, SHOWN_CENTRES_M)
        for centre, share in zip(SHOWN_CENTRES_M, windows, strict=True):
            found[f"H.window_accuracy.{system}.{centre}m"] = share
        found[f"H.accuracy_known.{system}"] = (said.vessel == truth.label)[known].mean()
        found[f"H.called_unknown.{system}.in_catalogue"] = said.unknown[known].mean()
        found[f"H.called_unknown.{system}.outside"] = said.unknown[~known].mean()
    found |= _confusion(truth, answers.of(BEST).decision, [*catalogue, UNKNOWN])
    return found | numbers.of_confidence("H", truth, answers) | numbers.of_pose("H", truth, answers, masks)


def slices(truth: Truth, vessels: int) -> Masks:
    """Masks of the clusters: all, bands of distance and points, sensors, occluded, aspect, known or not, type."""
    masks = {"overall": np.ones(len(truth.label), np.bool_), **numbers.band_slices(truth.range_m)}
    for part, (low, high) in zip(POINTS, POINT_BANDS, strict=True):
        masks[part] = (truth.points >= low) & (truth.points < (high or np.inf))
    masks |= {str(lidar): truth.lidar == lidar for lidar in np.unique(truth.lidar)}
    if np.isfinite(truth.hidden_share).all():
        occluded = truth.hidden_share >= OCCLUDED_FROM
        masks |= {"occluded": occluded, "not_occluded": ~occluded}
    masks |= numbers.aspect_slices(truth.aspect_deg)
    masks |= {"in_catalogue": truth.label < vessels, "outside": truth.label == vessels}
    masks |= {str(kind): truth.kind == kind for kind in np.unique(truth.kind)}
    return {part: mask for part, mask in masks.items() if mask.any()}


def window_accuracy(range_m: np.ndarray, right: np.ndarray, centres: Sequence[int]) -> np.ndarray:
    """Share right among the clusters within 15 m of each centre in range; NaN where there is none."""
    inside = np.abs(range_m[None] - np.asarray(centres)[:, None]) < WINDOW_M / 2
    counts = inside.sum(axis=1)
    return np.where(counts > 0, (inside & right).sum(axis=1) / np.maximum(counts, 1), np.nan)


def reach_m(range_m: np.ndarray, right: np.ndarray) -> float:
    """Range up to which every window keeps 95 %, metres; see the head of this module."""
    under = np.flatnonzero(window_accuracy(range_m, right, CENTRES_M) < LEAST_ACCURACY)
    if len(under) == 0:
        return float(FARTHEST_M)
    return float(CENTRES_M[under[0] - 1] if under[0] > 0 else NEAREST_M)


def _confusion(truth: Truth, decision: np.ndarray, names: Sequence[str]) -> Numbers:
    """Of the clusters of each class, the share that was called each class."""
    return {
        f"H.confusion.best.{true}.{said}": (decision[truth.label == i] == j).mean()
        for i, true in enumerate(names)
        for j, said in enumerate(names)
        if (truth.label == i).any()
    }
