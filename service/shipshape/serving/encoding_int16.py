"""Packed int16 steps from an origin -> points, for callers to whom bytes matter more than half millimetres."""

import math

import numpy as np
from jaxtyping import Float32

from shipshape.errors import InvalidInput
from shipshape.quantised import POINT_BYTES, Quantised, dequantise
from shipshape.serving.encoding import Limits, check_points


def points_from_int16(
    packed: bytes, origin_level: tuple[float, float, float], scale: float, limits: Limits
) -> Float32[np.ndarray, "n 3"]:
    """The points, level frame, metres; what is not finite in float32 passes: the pipeline refuses it.

    Args:
        packed: Little-endian int16 x y z, 6 bytes a point.
        origin_level: Position of the steps 0 0 0, metres.
        scale: Metres a step.
        limits: On points.

    Raises:
        InvalidInput: No whole points, or a scale that is not above 0.
        TooLarge: More points than the limit.
    """
    if len(packed) % POINT_BYTES:
        raise InvalidInput(
            f"expected {POINT_BYTES} bytes a point (little-endian int16 x, y, z), "
            f"got {len(packed)} bytes, {len(packed) % POINT_BYTES} too many for whole points"
        )
    if not 0 < scale < math.inf:
        raise InvalidInput(f"expected a scale of int16 points above 0, got {scale:g}")
    if not all(map(math.isfinite, origin_level)):
        raise InvalidInput("expected a finite origin of int16 points, got one that is not")
    check_points(len(packed) // POINT_BYTES, limits)
    return dequantise(Quantised(packed, origin_level, scale))
