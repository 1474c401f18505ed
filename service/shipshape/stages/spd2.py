"""SPD2: an image of the neighbourhood of one keypoint: spherical strata, point projection, diameter, distance.

The original definition is not public; this is our own. The neighbours within R of the keypoint are projected
onto a sphere around it, in the frame of the points (z up, x to the bow where the cloud is aligned): 16 rows of
elevation (zenith first) x 32 columns of azimuth (from -pi). Five channels in [0, 1], 0 where nothing lies:

    0-2  evidence of occupancy in three equal shells of distance (near, middle, far): 1 - exp(-n / 2)
    3    distance: 1 - d_min / R, the nearest neighbour in that direction
    4    diameter: (d_max - d_min) / R, how deep the structure in that direction is
"""

import numpy as np
from jaxtyping import Float32, UInt8

from shipshape import kernels

STRATA, ROWS, COLUMNS = 3, 16, 32
CHANNELS = STRATA + 2


def describe(
    points: Float32[np.ndarray, "n 3"], keypoints: Float32[np.ndarray, "k 3"], radius: float
) -> Float32[np.ndarray, "k 5 16 32"]:
    """One SPD2 image for each keypoint; points and keypoints in the same frame, `radius` R in metres."""
    count, nearest, farthest = kernels.bin_spherically(points, keypoints, radius, (STRATA, ROWS, COLUMNS))
    images = np.empty((len(keypoints), CHANNELS, ROWS, COLUMNS), np.float32)
    images[:, :STRATA] = 1 - np.exp(np.multiply(count, -0.5, dtype=np.float32))
    images[:, STRATA] = np.where(farthest > 0, 1 - nearest / radius, 0)
    images[:, STRATA + 1] = (farthest - nearest) / radius
    return images


def to_grey(images: Float32[np.ndarray, "k 5 16 32"]) -> UInt8[np.ndarray, "k 5 16 32"]:
    """The images in bytes, for people: 0 to 1 becomes 0 to 255."""
    grey: UInt8[np.ndarray, "k 5 16 32"] = np.rint(images * 255).astype(np.uint8)
    return grey
