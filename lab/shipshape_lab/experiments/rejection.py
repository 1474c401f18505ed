"""The numbers of set U against P: how well "unknown" tells what no model was trained on from the catalogue.

AUROC is the chance that a cluster of U is given a higher probability of "unknown" than a cluster of P, ties half.
U is scanned as P is, at the same ranges, so that nothing but what is scanned differs. Real hulls of a type that is
in the catalogue are no fair "unknown": they are left out and reported apart. A patrol boat of the navy that is
twice as long as the catalogue's stays in.

The slices `generated` and `real` are kept apart because only the generated outsiders were seen by nobody before:
that what is longer than 1.25 times the longest vessel is unknown was settled after a look at the real ships, and
the simulated types were drawn with pictures of the real hulls beside them.
"""

import numpy as np
from scipy.stats import mannwhitneyu

from shipshape_lab.experiments import numbers
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.predictions import Answers, Truth
from shipshape_lab.experiments.systems import IMAGE_METHODS
from shipshape_lab.simulator.outsiders import OUTSIDER_TYPES

GROUPS = ("generated", "real")  # slices of U beside its kinds
# Real hull -> the catalogue's type that it is of.
KIN = {"bc_hurricane_rhib": "rhib", "gz_fishingboat": "fishing_boat", "oc_tugboat": "tug"}


def of_answers(unknown: tuple[Truth, Answers], known: tuple[Truth, Answers]) -> Numbers:
    """AUROC and shares called unknown, for each system that has an "unknown" and answered both sets.

    Args:
        unknown: set U.
        known: set P.

    Raises:
        ValueError: a system's answers to the two sets are of different bundles or peers.
    """
    truth, answers = unknown
    kin = np.isin(truth.kind, list(KIN))
    generated = np.isin(truth.kind, OUTSIDER_TYPES)
    masks = {"": ~kin, ".generated": generated, ".real": ~kin & ~generated}
    masks |= {f".{kind}": truth.kind == kind for kind in np.unique(truth.kind[~kin])}
    masks = {end: mask for end, mask in masks.items() if mask.any()}
    found: Numbers = {"U.clusters": int((~kin).sum()), "U.refused": numbers.refused(answers)}
    for system, key in zip(answers.system.tolist(), answers.key.tolist(), strict=True):
        _check_same(system, key, known[1])
        said, against = answers.of(system), known[1].of(system)
        negative = against.probabilities[against.answered, -1]
        for end, mask in masks.items():
            positive = said.probabilities[said.answered & mask, -1]
            found[f"U.auroc.{system}{end}"] = auroc(positive, negative)
            found[f"U.called_unknown.{system}{end}"] = said.unknown[mask].mean()
        for hull in np.unique(truth.kind[kin]):
            own = truth.kind == hull
            found[f"U.kin.{system}.{hull}.called_unknown"] = said.unknown[own].mean()
            found[f"U.kin.{system}.{hull}.called_its_type"] = (said.decision == _label(KIN[hull], known))[
                own
            ].mean()
    return found


def _check_same(system: str, key: str, known: Answers) -> None:
    asked = dict(zip(known.system.tolist(), known.key.tolist(), strict=True))
    if system in IMAGE_METHODS or asked.get(system) != key:
        raise ValueError(
            f"expected {system} to have answered P as {key[:12]} too, got {asked.get(system, 'no answers')[:12]}: "
            "evaluate --set P again"
        )


def _label(kind: str, known: tuple[Truth, Answers]) -> int:
    """Class number of a catalogue type, read off the clusters of P; -2 where P has none of it."""
    labels = known[0].label[known[0].kind == kind]
    return int(labels[0]) if len(labels) else -2


def auroc(positive: np.ndarray, negative: np.ndarray) -> float:
    """Chance that a positive score is higher than a negative one, ties half; NaN where there is none of a kind."""
    if len(positive) == 0 or len(negative) == 0:
        return float("nan")
    return float(mannwhitneyu(positive, negative).statistic / (len(positive) * len(negative)))
