"""Reason codes: when an answer is less sure than most, and why.

Each rule compares one measure of the finished work with one threshold in `[parameters.reasons]` of the manifest:

few_points        fewer points than `few_points`
end_on            the line of sight is closer than `end_on_deg` to the vessel's long axis
occluded          the share of the silhouette that is missing is over `occluded_above`; needs a restored vessel
bow_uncertain     the bow probability is below `bow_below`
out_of_catalogue  the answer is "unknown"; its threshold is `common.unknown_above`

`training/reason_thresholds.py` of the lab fits the thresholds for preset `best` on the validation set. A bundle
without a threshold never gives that code. Preset `paper` is held to the same thresholds.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shipshape import frames, kernels
from shipshape.types import Reason, RestoredCloud
from shipshape.work import Work


@dataclass(frozen=True, slots=True)
class Measures:
    """What the rules look at."""

    points: int  # of the cluster
    off_ends_deg: float  # angle between the line of sight and the vessel's long axis: 0 end-on, 90 abeam
    missing_share: float  # of the silhouette, as `missing_share` has it
    bow_probability: float


def measure(work: Work, *, restored: bool = True) -> Measures:
    """The measures of a contact; of one that was not restored, nobody knows what is missing."""
    aspect = frames.aspect_deg(work.pose.heading, work.pose.origin_level)
    waterline = work.pose.origin_level[2]
    return Measures(
        points=len(work.contact.points_level),
        off_ends_deg=min(aspect, 180.0 - aspect),
        missing_share=missing_share(work.restored, work.sight.bearing, waterline) if restored else 0.0,
        bow_probability=work.bow_probability,
    )


def reasons_of(found: Measures, *, unknown: bool, thresholds: Mapping[str, int | float]) -> tuple[Reason, ...]:
    """The reasons that hold, in the order of `Reason`."""
    holds = {
        Reason.FEW_POINTS: found.points < thresholds.get("few_points", 0),
        Reason.END_ON: found.off_ends_deg < thresholds.get("end_on_deg", 0.0),
        Reason.OCCLUDED: found.missing_share > thresholds.get("occluded_above", 1.0),
        Reason.BOW_UNCERTAIN: found.bow_probability < thresholds.get("bow_below", 0.0),
        Reason.OUT_OF_CATALOGUE: unknown,
    }
    return tuple(reason for reason in Reason if holds[reason])


# Wide enough that an empty column means something; these three were compared by ROC on the validation set.
_POINTS_A_COLUMN = 6
_FEWEST_COLUMNS, _MOST_COLUMNS = 4, 24


def missing_share(restored: RestoredCloud, bearing: float, waterline: float) -> float:
    """Share of the restored silhouette whose points are missing, as if something stood in front of it; 0 to 1.

    The vessel as the sensor sees it is cut into upright columns of equal angle. A column of height h (restored,
    above the water) with n measured points has the density n / h. What a column lacks to the median density of
    those that were measured is missing, weighted by its height; a column denser than that lacks nothing.

    Args:
        restored: the whole vessel, level frame.
        bearing: of the line of sight, radians counter-clockwise from +x of the level frame.
        waterline: z of the water in the level frame, m.
    """
    count = min(max(int(np.count_nonzero(restored.measured)) // _POINTS_A_COLUMN, _FEWEST_COLUMNS), _MOST_COLUMNS)
    # Preset paper: the whole cluster may lie outside its image, and then all is missing.
    return kernels.missing_share(restored.points_level, restored.measured, bearing, float(waterline), count)
