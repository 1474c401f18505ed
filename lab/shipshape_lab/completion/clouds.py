"""What the completion networks see and give: clouds in the vessel frame of a pose, in lengths of the vessel."""

import numpy as np

from shipshape.types import Pose
from shipshape_lab.training.examples import Example
from shipshape_lab.training.train_inpainting import guess


def resampled(points: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Exactly `count` of the points (n, 3) in random order; each comes before any comes again."""
    rounds = [rng.permutation(len(points)) for _ in range(-(-count // len(points)))]
    return points[np.concatenate(rounds)[:count]]


def to_unit(points_level: np.ndarray, pose: Pose) -> np.ndarray:
    """Level-frame points (n, 3), m, in the vessel frame of `pose`, divided by its length."""
    return pose.to_vessel(points_level) / np.float32(pose.size.length)


def from_unit(points: np.ndarray, pose: Pose) -> np.ndarray:
    """The inverse of `to_unit`."""
    return pose.to_level(points * np.float32(pose.size.length))


def to_item(example: Example, sizes: tuple[int, int], rng: np.random.Generator) -> dict:
    """A training example, in the pose that inpainting would be handed.

    Args:
        example: a cluster as training sees it.
        sizes: points of the cluster, points of the complete surface.
        rng: chance.

    Returns:
        cloud (sizes[0], 3) and target (sizes[1], 3), in random order.
    """
    pose = guess(example, rng)
    seen, whole = sizes
    return {
        "cloud": to_unit(resampled(example.contact.points_level, seen, rng), pose),
        "target": to_unit(resampled(example.surface_level, whole, rng), pose),
    }
