"""Fit from which value on each reason code is given (`shipshape.reasons`), on validation answers of preset `best`.

few_points      the number of points from which on TRUSTED of the catalogue's vessels are named right
bow_below       the bow probability from which on TRUSTED of the bows are right
end_on_deg      the angle off the ends from which on the length is wrong at most LENGTH_RATIO times as often as
                abeam; class, bow and heading do not suffer end-on, the length does
occluded_above  the missing share that best tells (F1) what is hidden to MUCH_HIDDEN or more from all the rest

"From which on" is where an isotonic fit of the right answers over the measure crosses the share asked for.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import isotonic_regression

TRUSTED = 0.95
LENGTH_RATIO = 1.5
ABEAM_DEG = 45.0  # farther off the ends than this, the length shows as well as it ever does
MUCH_HIDDEN = 0.2  # of the returns


@dataclass(frozen=True)
class Judged:
    """Answers of validation contacts beside the truth, arrays of shape (M,).

    Attributes:
        points: how many points each has.
        off_ends_deg: angle between line of sight and long axis, as estimated.
        missing_share: as the service measures it, 0 to 1.
        bow_probability: calibrated, 0.5 to 1.
        catalogue: whether it is a vessel of the catalogue.
        named_right: whether it was called what it is: that vessel, or unknown.
        bow_right: whether the bow points the right way.
        length_right: whether the length is within 10 %.
        hidden_share: of the returns, taken away by something in front; NaN where the set does not say.
    """

    points: np.ndarray
    off_ends_deg: np.ndarray
    missing_share: np.ndarray
    bow_probability: np.ndarray
    catalogue: np.ndarray
    named_right: np.ndarray
    bow_right: np.ndarray
    length_right: np.ndarray
    hidden_share: np.ndarray


def reason_thresholds(judged: Judged) -> dict:
    """The table `[parameters.reasons]`; without `occluded_above` if no contact says how much of it was hidden."""
    known = judged.catalogue
    few = int(trusted_from(judged.points[known], judged.named_right[known], TRUSTED))
    found = {
        "few_points": few,
        "bow_below": trusted_from(judged.bow_probability[known], judged.bow_right[known], TRUSTED),
        "end_on_deg": _end_on(judged, known & (judged.points >= few)),
    }
    told = np.isfinite(judged.hidden_share)
    if told.any():
        hidden = judged.hidden_share[told] >= MUCH_HIDDEN
        found["occluded_above"] = best_cut(judged.missing_share[told], hidden)
    return found


def trusted_from(values: np.ndarray, right: np.ndarray, share: float) -> float:
    """The smallest value from which on an isotonic fit of `right` reaches `share`; the largest if none does."""
    order = np.lexsort((~right, values))  # among equal values the right first, so that the fit pools them
    fitted = isotonic_regression(right[order].astype(np.float64)).x
    reached = np.flatnonzero(fitted >= share)
    return float(values[order][reached[0] if len(reached) else -1])


def best_cut(values: np.ndarray, wanted: np.ndarray) -> float:
    """The cut with the highest F1 = 2 hits / (given + wanted) of "over the cut" against `wanted`; 1 if none is."""
    if not wanted.any():
        return 1.0
    order = np.argsort(-values)
    hits = np.cumsum(wanted[order])
    f1 = 2 * hits / (np.arange(1, len(values) + 1) + wanted.sum())
    last = int(np.argmax(f1))
    following = values[order][min(last + 1, len(values) - 1)]
    return float((values[order][last] + following) / 2)


def _end_on(judged: Judged, of: np.ndarray) -> float:
    angle, right = judged.off_ends_deg[of], judged.length_right[of]
    abeam = angle >= ABEAM_DEG
    if not abeam.any():
        return 0.0
    wrong = 1.0 - right[abeam].mean()
    return min(trusted_from(angle, right, 1.0 - LENGTH_RATIO * wrong), ABEAM_DEG)
