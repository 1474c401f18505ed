"""How a caller wants its contacts computed, and what it wants to see of them."""

from dataclasses import dataclass

from shipshape.executor import Lane
from shipshape.types import ImageMethod, Preset, Rung


@dataclass(frozen=True, slots=True)
class Wishes:
    """What goes with a request; the proto's `Options` says more of each."""

    preset: Preset = Preset.BEST
    image_method: ImageMethod = ImageMethod.FULL_SIDE  # used by preset `paper` alone
    lane: Lane = Lane.TRACKING  # what the answer is for: who goes first when workers are short
    lowest_rung: Rung = Rung.HEADING_AND_BOX  # the cheapest answer that is better than none
    bundle: str = ""  # name or digest that the caller insists on; empty: whichever runs
    captured_at: float | None = None  # seconds since 1970 (UTC) at which the LiDAR saw the contacts
    max_age_ms: float | None = None  # an answer is worth nothing when what it tells is older; needs captured_at
    restored: bool = False  # put the whole vessel's points into the answer
    images: bool = False  # put the images before and after inpainting into it
    png: bool = False  # put a picture for people into it
