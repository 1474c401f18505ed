"""Keypoints: the densest points of a cloud, spread out (paper, section 3.3.1).

n_i = number of other points within r of point i; points are taken by descending n_i, each at least d_min from
every one taken before. r and d_min are in metres; ties go to the point smaller in (x, y, z).
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from shipshape import kernels

MOST_POINTS = 16_384


@dataclass(frozen=True, slots=True)
class KeypointParams:
    """How densest is measured and how far apart keypoints lie (paper, Table 5: 0.5 and 0.5)."""

    radius: float = 0.5  # r, m
    spacing: float = 0.5  # d_min, m
    limit: int = 3  # most keypoints to select


def select_keypoints(points: Float32[np.ndarray, "n 3"], params: KeypointParams) -> Float32[np.ndarray, "k 3"]:
    """The densest points of `points` in any frame, densest first; fewer than the limit if the cloud is small.

    Of a cloud of more than MOST_POINTS every k-th point is taken: the densest places stay the densest, and the
    neighbours of a crowded cloud, whose number grows with its square, cannot hold a worker for seconds.
    """
    # Contiguous, or the kernels would be compiled once more for strided arrays.
    points = np.ascontiguousarray(points[:: max(1, math.ceil(len(points) / MOST_POINTS))])
    counts = kernels.count_neighbours(points, params.radius)
    chosen: Float32[np.ndarray, "k 3"] = points[
        kernels.select_spread(points, counts, params.spacing, params.limit)
    ]
    return chosen
