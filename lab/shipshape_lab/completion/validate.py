"""How good a completion network is on the validation set, in the poses that training disturbs.

Scores are those of `shipshape_lab.metrics`, against up to 16,384 points of the complete surface, level frame.
"""

from collections.abc import Callable

import numpy as np
from tqdm import tqdm

from shipshape.types import Pose
from shipshape_lab import metrics
from shipshape_lab.completion.load import Completer
from shipshape_lab.training.examples import Example, Examples
from shipshape_lab.training.train_inpainting import guess

SURFACE_POINTS = 16_384
Restore = Callable[[np.ndarray, Pose], np.ndarray]


def drawn(validation: Examples, count: int) -> list[tuple[Example, Pose]]:
    """An even share of about `count` clusters, each with a disturbed pose; the same at every call."""
    found = []
    for i in validation.indices[:: max(1, len(validation) // count)]:
        rng = np.random.default_rng([0, int(i)])
        example = validation.drawn(int(i), rng)
        found.append((example, guess(example, rng)))
    return found


def scores(restore: Restore, clusters: list[tuple[Example, Pose]]) -> dict:
    """Mean CD-L1 x 1000, F-score@1% and number of points of restored clouds."""
    rows = []
    for example, pose in tqdm(clusters, desc="validate", mininterval=2.0, leave=False):
        cloud = restore(example.contact.points_level, pose)
        surface = np.random.default_rng(0).permutation(example.surface_level)[:SURFACE_POINTS]
        extent = max(example.pose.size.length, example.pose.size.beam, example.pose.size.height)
        nearest = metrics.CompleteSurface(surface, extent).nearest(cloud)
        rows.append((metrics.chamfer_l1(nearest) * metrics.REPORTED_FACTOR, metrics.f_score(nearest), len(cloud)))
    means = np.mean(rows, axis=0)
    return {"cd_l1": round(float(means[0]), 3), "fscore": round(float(means[1]), 4), "points": round(means[2])}


def measured_helps(completer: Completer, clusters: list[tuple[Example, Pose]]) -> tuple[bool, dict]:
    """Whether CD-L1 is lower with the measured points added, and the scores of both."""
    choices = {
        with_measured: scores(
            Completer(completer.name, completer.net, completer.seen, with_measured).complete, clusters
        )
        for with_measured in (False, True)
    }
    both = {"drawn": choices[False], "with_measured": choices[True]}
    return choices[True]["cd_l1"] < choices[False]["cd_l1"], both
