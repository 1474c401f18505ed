"""Bisection for the highest rate that holds the budget."""

import math
from collections.abc import Callable

PRECISION = 0.05  # of the rate found
SLOWEST = 1.0  # contacts a second: a target that does not hold this holds nothing


def highest_held(holds: Callable[[float], bool], first: float, precision: float = PRECISION) -> float:
    """The highest rate that holds, at most `precision` below one that does not; 0 when even the slowest does not.

    Args:
        holds: Tries a rate; each at most once.
        first: The rate to begin with; doubled or halved until the answer lies between two rates.
        precision: A share of the rate.
    """
    held, broken, rate = 0.0, math.inf, first
    while held * (1 + precision) < broken:
        if holds(rate):
            held = rate
        else:
            broken = rate
        if broken <= SLOWEST:
            return 0.0
        if held == 0:
            rate = max(SLOWEST, rate / 2)
        else:
            rate = held * 2 if broken == math.inf else math.sqrt(held * broken)
    return held
