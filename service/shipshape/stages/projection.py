"""Projection: an aligned cloud to an image and its pixel-to-metre transform (paper, section 3.2).

The paper's four images are 64 x 64 with three layers of depth in B, G, R. *Full* scales x, y and z alike so
that the vessel's largest extent fills the image; *Z* scales only the height to the full range and keeps x and y
at one scale for the whole catalogue. Top views look down (depth is z); side views look from port (depth is y,
over the beam): which depths the layers of a side view hold is not in the paper, see docs/adr/0004.
"""

import numpy as np
from jaxtyping import Float32

from shipshape import raster
from shipshape.raster import ImageFrame, Layers
from shipshape.types import ImageMethod, Pose, ReferenceBox

PIXELS = 64  # paper, section 3.2.1
_MARGIN = 1.1  # headroom around the reference box for hulls larger than it and for errors of alignment
_THIRDS = (0.0, 1 / 3, 2 / 3, 1.0)


def paper_frame(method: ImageMethod, size: ReferenceBox, longest: float) -> ImageFrame:
    """The image of one of the paper's four methods.

    Args:
        method: normalisation and view.
        size: reference box of the vessel, m.
        longest: length of the longest vessel of the catalogue, m: the scale of *Z* images.
    """
    full = method in (ImageMethod.FULL_TOP, ImageMethod.FULL_SIDE)
    extent = _MARGIN * (max(size.length, size.beam, size.height) if full else longest)
    height = extent if full else _MARGIN * size.height
    half = extent / 2
    if method in (ImageMethod.FULL_TOP, ImageMethod.Z_TOP):
        axes, lower, upper = (0, 1, 2), (-half, -half, 0.0), (half, half, height)
    else:
        side = _MARGIN * size.beam / 2
        axes, lower, upper = (0, 2, 1), (-half, 0.0, -side), (half, height, side)
    return ImageFrame(axes, lower, upper, (PIXELS, PIXELS), _THIRDS)


def project(points_level: Float32[np.ndarray, "n 3"], pose: Pose, frame: ImageFrame) -> Layers:
    """Layers of a level-frame cloud seen in the vessel frame of `pose`."""
    return raster.rasterise(pose.to_vessel(points_level), frame)
