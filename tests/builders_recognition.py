"""A contact and its recognition without any model: a box hull of which the sensor saw one side."""

import math
from pathlib import Path

import numpy as np

from shipshape import frames
from shipshape.types import (
    Box,
    Contact,
    ImageMethod,
    ImagePair,
    Preset,
    Reason,
    Recognition,
    ReferenceBox,
    RestoredCloud,
    Rung,
)

SIZE = ReferenceBox(length=12.0, beam=4.0, height=3.0)
STAGES = (
    "prior",
    "heading",
    "bow_stern",
    "projection",
    "inpainting",
    "lifting",
    "keypoints",
    "spd2",
    "classification",
)


def side_of_hull(heading: float, origin: tuple[float, float, float], count: int = 80) -> np.ndarray:
    """Points on the starboard side of the box hull, level frame, float32 (count, 3)."""
    rng = np.random.default_rng(1)
    points = rng.uniform((-6, -2, 0), (6, -1.8, 3), (count, 3)).astype(np.float32)
    return frames.to_level(points, heading, origin)


def write_scan(path: Path) -> Path:
    """Three clusters of which the second has too few points."""
    good = side_of_hull(0.5, (40.0, 5.0, -3.0))
    np.savez(path, points=np.concatenate([good, good[:3], good]), n=np.array([80, 3, 80]))
    return path


def recognised(
    *, heading: float = 0.5, unknown: bool = False, preset: Preset = Preset.BEST, inferred: int = 200
) -> tuple[Contact, Recognition]:
    """A contact 40 m ahead, and a recognition that got it right."""
    origin = (40.0, 5.0, -3.0)
    measured = side_of_hull(heading, origin)
    guessed = np.random.default_rng(2).uniform((-6, -2, 0), (6, 2, 3), (inferred, 3)).astype(np.float32)
    cloud = np.concatenate([measured, frames.to_level(guessed, heading, origin)])
    image = np.zeros((32, 64, 3) if preset is Preset.BEST else (64, 64, 3), np.uint8)
    image[10:20, 10:40, 0], image[12:18, 20:30, 1] = 200, 90
    paper = preset is Preset.PAPER
    recognition = Recognition(
        vessel="pilot_boat",
        probability=0.3 if unknown else 0.97,
        probabilities={
            "pilot_boat": 0.3 if unknown else 0.97,
            "tug": 0.01,
            "unknown": 0.69 if unknown else 0.02,
        },
        unknown=unknown,
        reasons=(Reason.OUT_OF_CATALOGUE,) if unknown else (),
        heading=heading,
        heading_std=math.radians(2.0),
        bow_probability=0.99,
        aspect_deg=frames.aspect_deg(heading, origin),
        true_heading_deg=None,
        box=Box((origin[0], origin[1], origin[2] + SIZE.height / 2), SIZE),
        restored=RestoredCloud(cloud, np.arange(len(cloud)) < len(measured)),
        images=ImagePair(image, np.maximum(image, image[:, ::-1])),
        keypoints_level=cloud[:3],
        rung=Rung.FULL,
        rung_reason="",
        preset=preset,
        image_method=ImageMethod.FULL_TOP if paper else None,
        bundle="0123456789abcdef" * 4,
        stage_ms=dict.fromkeys(STAGES, 0.4),
    )
    return Contact(measured, contact_id="7", sensor_height=3.0), recognition
