"""Sea states as the motion that they give a vessel, and the pose of a vessel in the level frame."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Motion:
    """Roll and pitch in radians and heave in metres, about the origin of the vessel frame.

    Roll is positive with the port side up, pitch with the bow down (right-handed about x and y), heave up.
    """

    roll: float = 0.0
    pitch: float = 0.0
    heave: float = 0.0


@dataclass(frozen=True)
class SeaState:
    """Standard deviations of roll and pitch, degrees, and of heave, metres."""

    roll_sd_deg: float
    pitch_sd_deg: float
    heave_sd: float

    def draw(self, rng: np.random.Generator) -> Motion:
        """One moment of this sea: independent normal roll, pitch and heave."""
        roll, pitch, heave = rng.standard_normal(3)
        return Motion(
            roll=float(np.radians(roll * self.roll_sd_deg)),
            pitch=float(np.radians(pitch * self.pitch_sd_deg)),
            heave=float(heave * self.heave_sd),
        )


LIGHT_SEA = SeaState(roll_sd_deg=2.0, pitch_sd_deg=1.0, heave_sd=0.15)
MODERATE_SEA = SeaState(roll_sd_deg=4.0, pitch_sd_deg=2.0, heave_sd=0.35)


@dataclass(frozen=True)
class Placement:
    """Where a vessel lies, as the sensor sees it in the level frame.

    Attributes:
        range_m: horizontal distance from the sensor to the origin of the vessel frame, metres.
        heading: yaw of the vessel frame in the level frame, counter-clockwise, radians.
        bearing: direction of the vessel's origin from the sensor, counter-clockwise from x, radians.
        sensor_height: height of the sensor above the waterline, metres.
    """

    range_m: float
    heading: float
    bearing: float = 0.0
    sensor_height: float = 3.0

    @property
    def aspect_deg(self) -> float:
        """Angle from the bow to the line of sight back to the sensor: 0 bow-on, 180 stern-on, degrees."""
        turn = self.bearing + np.pi - self.heading
        return float(np.degrees(abs(np.arctan2(np.sin(turn), np.cos(turn)))))

    def T_level_vessel(self, motion: Motion = Motion()) -> np.ndarray:
        """Pose of the vessel frame in the level frame: yaw, then pitch, then roll; shape (4, 4), float64."""
        transform = np.eye(4)
        transform[:3, :3] = _rotation(self.heading, motion)
        x, y = self.range_m * np.cos(self.bearing), self.range_m * np.sin(self.bearing)
        transform[:3, 3] = x, y, motion.heave - self.sensor_height
        return transform


def _rotation(heading: float, motion: Motion) -> np.ndarray:
    (cy, sy), (cp, sp), (cr, sr) = (
        (np.cos(angle), np.sin(angle)) for angle in (heading, motion.pitch, motion.roll)
    )
    yaw = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    pitch = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    roll = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return yaw @ pitch @ roll
