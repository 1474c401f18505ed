"""What is written on the command line -> numbers."""

import math
import re

from shipshape.errors import SettingsError

UNITS_S = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "m": 60.0, "h": 3600.0, "": 1.0}


def seconds_of(text: str, *, none: bool = False) -> float:
    """The seconds in 50ms, 2s, 1m or 2; raises SettingsError for anything else, and for 0 unless `none` may be."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(us|ms|s|m|h|)", text)
    if match is None or (float(match[1]) == 0 and not none):
        raise SettingsError(f"expected a time like 50ms, 2s or 1m, got {text!r:.80}")
    return float(match[1]) * UNITS_S[match[2]]


def weights_of(text: str) -> dict[str, float]:
    """The weights in 50,300=8,2000: 1 where none is given.

    Raises:
        SettingsError: A name twice, or a weight that is no number above 0.
    """
    weights: dict[str, float] = {}
    for part in text.split(","):
        name, _, given = part.strip().partition("=")
        try:
            weight = float(given or 1)
        except ValueError:
            weight = math.nan
        if not name or name in weights or not 0 < weight < math.inf:
            raise SettingsError(f"expected a list like 50,300=8,2000, each once, got {text!r:.80}")
        weights[name] = weight
    return weights
