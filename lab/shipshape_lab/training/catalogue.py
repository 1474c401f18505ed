"""The reference boxes of a catalogue: what its nominal hulls measure above the water."""

from collections.abc import Sequence

from shipshape.types import ReferenceBox
from shipshape_lab.simulator.vessels import build_vessel


def reference_boxes(names: Sequence[str]) -> list[ReferenceBox]:
    """Length, beam and air height of the nominal hull of each name, metres."""
    return [ReferenceBox(*build_vessel(name).box) for name in names]
