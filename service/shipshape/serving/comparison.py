"""Two bundles' answers to one contact -> how far they are apart."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from shipshape.serving.encoding import Wishes
from shipshape.serving.model import Answer
from shipshape.types import ReferenceBox

UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Numbers:
    """What of an answer is compared."""

    vessel: str  # "unknown" where the contact is better treated so
    probabilities: Mapping[str, float]
    heading: float  # rad
    box: ReferenceBox  # m


@dataclass(frozen=True, slots=True)
class Difference:
    """How far two answers are apart."""

    vessels: tuple[str, str]
    axis_deg: float  # between the headings modulo 180, in [0, 90]
    opposite: bool  # the bow of one points where the other's stern does
    probability: float  # total variation: the share of the probability that lies elsewhere, in [0, 1]
    box_m: float  # of length, beam and height the one that differs most

    @property
    def same(self) -> bool:
        """Whether both say the same class."""
        return self.vessels[0] == self.vessels[1]


def numbers_of(answer: Answer, _: Wishes) -> Numbers:
    """The encoder of what is compared; on the worker."""
    found = answer.recognition
    vessel = UNKNOWN if found.unknown else found.vessel
    return Numbers(vessel, dict(found.probabilities), found.heading, found.box.size)


def compare(one: Numbers, other: Numbers) -> Difference:
    """How far they are apart. Classes that only one of the two bundles knows have probability 0 in the other."""
    turn = abs(math.remainder(one.heading - other.heading, math.tau))
    opposite = turn > math.pi / 2
    names = one.probabilities.keys() | other.probabilities.keys()
    moved = sum(abs(one.probabilities.get(name, 0.0) - other.probabilities.get(name, 0.0)) for name in names)
    sizes = zip(_sizes(one.box), _sizes(other.box), strict=True)
    return Difference(
        (one.vessel, other.vessel),
        math.degrees(math.pi - turn if opposite else turn),
        opposite,
        moved / 2,
        max(abs(first - second) for first, second in sizes),
    )


def _sizes(box: ReferenceBox) -> tuple[float, float, float]:
    return box.length, box.beam, box.height
