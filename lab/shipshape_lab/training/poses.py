"""Poses that training hands to a network: what the stage before it would have found, right or not quite."""

import math

import numpy as np

from shipshape.stages import heading
from shipshape.types import Pose, ReferenceBox
from shipshape_lab.training.examples import Example


def paper_pose(example: Example, boxes: list[ReferenceBox]) -> Pose:
    """The pose that the paper's search finds when the class and the bow are right."""
    points, box = example.contact.points_level, boxes[example.label]
    axis = heading.by_area_projection(points, box)
    if np.cos(axis - example.pose.heading) < 0:
        axis += np.pi
    height = example.contact.sensor_height
    waterline = float(points[:, 2].min()) if height is None else -height
    return heading.anchor_box(points, axis, box, waterline)


def disturbed(pose: Pose, rng: np.random.Generator, *, wide: bool) -> Pose:
    """A pose as an earlier stage might hand it on: turned, shifted and of another size.

    Args:
        pose: the truth.
        rng: chance.
        wide: the errors of the first look along the line of sight; otherwise those after the aligned looks.
    """
    turn, shift, scale = (10.0, 0.08, 0.15) if wide else (1.5, 0.015, 0.05)
    spread = rng.choice([0.3, 1.0, 2.5], p=[0.4, 0.45, 0.15])
    length = pose.size.length
    step = rng.normal(0.0, shift * spread * length, 3) * np.array([1.0, 0.6, 0.4])
    grown = length * math.exp(rng.normal(0.0, scale * min(spread, 1.5)))
    x, y, z = np.array(pose.origin_level) + step
    return Pose(
        pose.heading + math.radians(rng.normal(0.0, turn * spread)),
        (float(x), float(y), float(z)),
        ReferenceBox(grown, pose.size.beam, pose.size.height),
    )
