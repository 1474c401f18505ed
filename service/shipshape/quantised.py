"""Points as int16 steps from an origin: half the bytes of float32, for links that cost by the byte.

docs/client.md says what it costs in accuracy, and `benchmarks/quantised.py` measures it.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from shipshape.errors import InvalidInput

STEP = np.dtype("<i2")
POINT_BYTES = 3 * STEP.itemsize
MOST_STEPS = 32767  # from the origin, along each axis
USUAL_SCALE = 1e-3  # m, of points that all lie in one place


@dataclass(frozen=True, slots=True)
class Quantised:
    """Points of the level frame: a coordinate is that of the origin and `scale` times its number of steps."""

    steps: bytes  # packed little-endian int16 x y z, 6 bytes a point
    origin_level: tuple[float, float, float]  # m
    scale: float  # m a step


def quantise(points_level: Float32[np.ndarray, "n 3"], scale: float | None = None) -> Quantised:
    """The nearest steps, none farther than half a step from its point along each axis.

    Args:
        points_level: Metres.
        scale: Metres a step, or more where the points need it; None: as fine as int16 allows, a third of a
            millimetre for 20 m. Coarser steps save more bytes where a link compresses.

    Raises:
        InvalidInput: Points that are not finite, or a scale that is not above 0.
    """
    if scale is not None and not 0 < scale < math.inf:
        raise InvalidInput(f"expected a scale of int16 points above 0, got {scale:g}")
    points = points_level.astype(np.float64)
    if not np.isfinite(points).all():
        raise InvalidInput("expected finite points to quantise, got some that are not")
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3), np.zeros(3))
    origin, half = (low + high) / 2, float((high - low).max()) / 2
    chosen = max(half / MOST_STEPS, scale or 0.0) or USUAL_SCALE
    steps = np.clip(np.rint((points - origin) / chosen), -MOST_STEPS, MOST_STEPS)
    x, y, z = map(float, origin)
    return Quantised(steps.astype(STEP).tobytes(), (x, y, z), chosen)


def dequantise(quantised: Quantised) -> Float32[np.ndarray, "n 3"]:
    """The points, level frame, metres; `steps` has 6 bytes a point. What float32 cannot hold is infinite."""
    steps = np.frombuffer(quantised.steps, STEP).reshape(-1, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        points = np.asarray(quantised.origin_level) + quantised.scale * steps.astype(np.float64)
        return points.astype(np.float32)
