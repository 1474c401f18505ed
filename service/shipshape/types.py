"""The values that travel between stages: frozen, float32, SI units, radians; the frame is in the name.

Level frame (origin at the LiDAR)          Vessel frame (origin on the waterline, mid box)

        x ahead of the sensor's vessel             x bow
        ^                                          ^
        |                                          |
 y <----o  z up, towards you                y <----o  z up, z = 0 on the waterline
 port                                       port

`heading` is the yaw of the vessel frame in the level frame, counter-clockwise from +x, in (-pi, pi].
`aspect` is the angle from the vessel's bow to the line of sight back to the sensor: 0 bow-on, 90 abeam,
180 stern-on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from jaxtyping import Bool, Float32, UInt8

from shipshape import frames


class Preset(StrEnum):
    """Which set of methods the stages use."""

    PAPER = "paper"  # the paper's method to the letter wherever its text defines it
    BEST = "best"  # what measured best


class ImageMethod(StrEnum):
    """The paper's four image generation methods: {1:1:1, z only} normalisation x {top, side} view."""

    FULL_TOP = "full_top"
    FULL_SIDE = "full_side"
    Z_TOP = "z_top"
    Z_SIDE = "z_side"


class Rung(StrEnum):
    """Of the ladder of ever cheaper answers, the best first; what each leaves out is said in `pipeline`."""

    FULL = "full"
    WITHOUT_RESTORATION = "without_restoration"
    HEADING_AND_BOX = "heading_and_box"


class Reason(StrEnum):
    """Why an answer is less sure than most; `reasons` says exactly when each is given."""

    FEW_POINTS = "few_points"
    END_ON = "end_on"
    OCCLUDED = "occluded"
    BOW_UNCERTAIN = "bow_uncertain"
    OUT_OF_CATALOGUE = "out_of_catalogue"


@dataclass(frozen=True, slots=True)
class Contact:
    """One vessel to recognise: its cluster in the level frame and what the caller knows beside it."""

    points_level: Float32[np.ndarray, "n 3"]
    contact_id: str = ""
    sensor_height: float | None = None  # LiDAR above the water, m; None: the lowest point stands in
    own_true_heading_deg: float | None = None  # the caller's own bow, clockwise from true north


@dataclass(frozen=True, slots=True)
class Options:
    """How a contact is to be computed."""

    preset: Preset = Preset.BEST
    image_method: ImageMethod = ImageMethod.FULL_SIDE  # used by preset `paper` alone
    lowest_rung: Rung = Rung.HEADING_AND_BOX  # the cheapest answer that is better than none

    def accepts(self, rung: Rung) -> bool:
        """Whether an answer on this rung is better than none."""
        rungs = list(Rung)
        return rungs.index(rung) <= rungs.index(self.lowest_rung)


@dataclass(frozen=True, slots=True)
class ReferenceBox:
    """Outer size of a vessel above the waterline, metres."""

    length: float
    beam: float
    height: float


@dataclass(frozen=True, slots=True)
class Box:
    """Oriented box of the whole vessel; its yaw is the heading. Metres, level frame."""

    center_level: tuple[float, float, float]
    size: ReferenceBox


@dataclass(frozen=True, slots=True)
class Pose:
    """Where the vessel frame lies in the level frame, and how large the vessel is taken to be."""

    heading: float  # rad
    origin_level: tuple[float, float, float]  # on the waterline under the middle of the box, m
    size: ReferenceBox

    def turned(self, angle: float) -> "Pose":
        """The same vessel with its heading turned by `angle`, radians."""
        return Pose(frames.wrap_angle(self.heading + angle), self.origin_level, self.size)

    def to_vessel(self, points_level: Float32[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n 3"]:
        """Level-frame points in the vessel frame."""
        return frames.to_vessel(points_level, self.heading, self.origin_level)

    def to_level(self, points_vessel: Float32[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n 3"]:
        """Vessel-frame points in the level frame."""
        return frames.to_level(points_vessel, self.heading, self.origin_level)


@dataclass(frozen=True, slots=True)
class RestoredCloud:
    """The whole vessel: every measured point as it came, and the inferred ones."""

    points_level: Float32[np.ndarray, "m 3"]
    measured: Bool[np.ndarray, " m"]


@dataclass(frozen=True, slots=True)
class ImagePair:
    """The projected image and the inpainted one, 0 where empty.

    B, G, R hold the layers of depth in ascending order: lower, middle, upper in a top view; starboard, middle,
    port in a side view.
    """

    before: UInt8[np.ndarray, "rows columns 3"]
    after: UInt8[np.ndarray, "rows columns 3"]


def _none_described() -> UInt8[np.ndarray, "0 channels rows columns"]:
    return np.empty((0, 5, 16, 32), np.uint8)


@dataclass(frozen=True, slots=True)
class Recognition:
    """What Shipshape says of one contact."""

    vessel: str  # the most probable vessel of the catalogue, also when `unknown` says it is none of them
    probability: float
    probabilities: Mapping[str, float]  # every catalogue vessel and "unknown"; sums to 1
    unknown: bool  # true: better treated as not in the catalogue
    reasons: tuple[
        Reason, ...
    ]  # why to trust this answer less, in the order of `Reason`; empty: nothing speaks against it
    heading: float  # rad
    heading_std: float  # rad, of the heading modulo pi
    bow_probability: float  # that the bow points along `heading` and not the opposite way
    aspect_deg: float
    true_heading_deg: float | None  # clockwise from north; None unless the caller gave its own
    box: Box
    restored: RestoredCloud  # below rung `full`: the measured points alone
    images: ImagePair | None  # None below rung `full`
    keypoints_level: Float32[np.ndarray, "k 3"]  # none below rung `full`
    rung: Rung  # `full` unless time was short
    rung_reason: str  # why it is not `full`: a sentence; empty when it is
    preset: Preset
    image_method: ImageMethod | None  # None: the image of preset `best`
    bundle: str  # digest of the model bundle
    stage_ms: Mapping[str, float] = field(default_factory=dict)
    # SPD2 images of the keypoints, 255 for 1 (see `stages.spd2`); none below rung `full`
    descriptors: UInt8[np.ndarray, "described channels rows columns"] = field(default_factory=_none_described)

    @property
    def measured_points(self) -> int:
        """How many points of the restored cloud the sensor measured."""
        return int(np.count_nonzero(self.restored.measured))

    @property
    def inferred_points(self) -> int:
        """How many points of the restored cloud were inferred."""
        return len(self.restored.measured) - self.measured_points
