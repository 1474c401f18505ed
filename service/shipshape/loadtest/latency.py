"""Times -> their distribution, in HDR histograms of three digits."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from hdrh.histogram import HdrHistogram
from jaxtyping import Float64

LONGEST_US = 3_600_000_000  # that a histogram can hold: an hour
DIGITS = 3
PERCENTILES = (50.0, 90.0, 99.0, 99.9)
CURVE_STEPS = 12  # of the curve of percentiles, a factor of ten of what is left to 100 %


@dataclass(frozen=True, slots=True)
class Latency:
    """Milliseconds; None where nothing was measured."""

    count: int
    mean: float | None
    max: float | None
    percentiles: Mapping[str, float | None]  # "p50", "p90", ...
    curve: list[tuple[float, float]]  # percentile, milliseconds
    hdr: str  # the histogram itself, compressed and in base64, as HdrHistogram tools exchange it


def latency_of(seconds: Float64[np.ndarray, " n"]) -> Latency:
    """The distribution of some times."""
    histogram = HdrHistogram(1, LONGEST_US, DIGITS)
    for microseconds in np.clip(np.rint(seconds * 1e6), 1, LONGEST_US).astype(np.int64).tolist():
        histogram.record_value(microseconds)
    count = len(seconds)
    curve = _curve_percentiles(count)
    found = _values(histogram, [*PERCENTILES, *curve])
    return Latency(
        count=count,
        mean=float(seconds.mean()) * 1e3 if count else None,
        max=float(seconds.max()) * 1e3 if count else None,
        percentiles={f"p{percentile:g}": found.get(percentile) for percentile in PERCENTILES},
        curve=[(percentile, found[percentile]) for percentile in curve],
        hdr=histogram.encode().decode("ascii"),
    )


def _values(histogram: HdrHistogram, percentiles: Sequence[float]) -> dict[float, float]:
    """Milliseconds at each percentile: the first time that so many are not above."""
    count = histogram.get_total_count()
    if count == 0:
        return {}
    # The library rounds a rank to the nearest: p90 of six would be the fifth, above which are 17 %.
    ranks = {percentile: math.ceil(round(percentile / 100 * count, 6)) for percentile in percentiles}
    found = histogram.get_percentile_to_value_dict([100 * rank / count for rank in ranks.values()])
    return {percentile: found[100 * rank / count] / 1e3 for percentile, rank in ranks.items()}


def _curve_percentiles(count: int) -> list[float]:
    """From 0 on, ever nearer to 100, up to the last one that a single request can tell."""
    if count == 0:
        return []
    steps = np.arange(int(np.log10(count) * CURVE_STEPS) + 1) / CURVE_STEPS
    return [100.0 * (1.0 - 10.0**-step) for step in steps.tolist()]
