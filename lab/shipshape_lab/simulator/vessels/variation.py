"""Individual differences: how sister hulls of one type depart from the nominal one."""

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

SPREAD = 0.12  # standard deviation of every length, height, angle and position, as a share of its nominal value
CUT_OFF = 2.0  # draws beyond this many deviations are held there: past it a hull stops looking like its type
FLIP_CHANCE = 0.25  # chance that a piece of gear is absent where the nominal hull has it, or the reverse

Parameters = TypeVar("Parameters")


def varied(nominal: Parameters, rng: np.random.Generator) -> Parameters:
    """A sister of a nominal set of parameters: every field drawn independently.

    Args:
        nominal: a frozen dataclass of numbers, flags and further such dataclasses.
        rng: source of randomness; one draw for each field, in field order.

    Returns:
        The same dataclass: numbers with a fraction scaled by 1 + SPREAD * normal, whole numbers moved by at
        most one (never below zero), flags flipped with FLIP_CHANCE.
    """
    drawn = {field.name: _drawn(getattr(nominal, field.name), rng) for field in fields(nominal)}
    return replace(nominal, **drawn)


def _drawn(value: Any, rng: np.random.Generator) -> Any:
    if is_dataclass(value):
        return varied(value, rng)
    if isinstance(value, bool):
        return value != (rng.random() < FLIP_CHANCE)
    if isinstance(value, int):
        return max(0, value + int(rng.integers(-1, 2)))
    return value * (1.0 + SPREAD * float(np.clip(rng.standard_normal(), -CUT_OFF, CUT_OFF)))
