"""Training examples: a varied shape, what a random mask leaves of it, and the network's inputs and targets.

Only shapes of the official training list come here. Every tenth of a kind that has plenty is kept aside to fit
thresholds on, and the few guitars and toilets are drawn more often than they would be by their number.
"""

from dataclasses import dataclass

import numpy as np

from shipshape import raster
from shipshape.stages import inpainting, projection
from shipshape.types import ImageMethod
from shipshape_lab.modelnet import masks
from shipshape_lab.modelnet.methods import grey_frame, grey_image, layers_frame
from shipshape_lab.modelnet.shapes import KINDS, Shape, standing, turned

DRAWS = 8  # of each shape in an epoch
RARE_DRAWS = 80  # of each shape of a kind that has few
_FEW = 10
_VALIDATION_EVERY = 10
_LOSS_PERCENT = (20.0, 95.0)
_STRETCH = 0.08  # standard deviation of the logarithm of each side
_TURN_DEG = 3.0


def split_validation(shapes: list[Shape]) -> tuple[list[Shape], list[Shape]]:
    """Shapes to train on, and shapes to choose thresholds on."""
    kinds = [[shape for shape in shapes if shape.kind == kind] for kind in KINDS]
    aside = {shape.name for group in kinds if len(group) > _FEW for shape in group[::_VALIDATION_EVERY]}
    return [s for s in shapes if s.name not in aside], [s for s in shapes if s.name in aside]


def schedule(shapes: list[Shape]) -> list[Shape]:
    """The shapes of one epoch, each as often as it is drawn."""
    number = {kind: sum(shape.kind == kind for shape in shapes) for kind in KINDS}
    return [s for s in shapes for _ in range(DRAWS if number[s.kind] > _FEW else RARE_DRAWS)]


@dataclass(frozen=True)
class Masked:
    """A complete shape and what a mask left of it, both in the frame of the shape."""

    shape: Shape
    points: np.ndarray  # (m, 3) float32

    @classmethod
    def drawn(cls, shape: Shape, rng: np.random.Generator) -> "Masked":
        """A variation of `shape`, stretched, mirrored and slightly turned, under a random mask and loss."""
        stretch = np.exp(rng.normal(0.0, _STRETCH, 3)) * [*rng.choice([-1.0, 1.0], 2), 1.0]
        points = standing(
            turned(shape.points * stretch.astype(np.float32), np.radians(rng.normal(0.0, _TURN_DEG)))
        )
        mask = list(masks.MASKS)[rng.integers(len(masks.MASKS))]
        return cls(Shape(shape.name, points), points[masks.kept(points, mask, rng.uniform(*_LOSS_PERCENT), rng)])


def grey_item(masked: Masked, method: ImageMethod) -> dict:
    """Grey images in [0, 1] of what was left and of the complete shape, (3, 64, 64)."""
    pose = masked.shape.pose
    frame = grey_frame(method, pose.size)
    images = {"image": masked.points, "whole": masked.shape.points}
    return {
        name: grey_image(points, pose, frame).transpose(2, 0, 1).astype(np.float32) / 255
        for name, points in images.items()
    }


def layers_item(masked: Masked) -> dict:
    """Planes and features of what was left, and the layers of the complete shape, as `best` is trained."""
    pose = masked.shape.pose
    frame = layers_frame(pose.size)
    left, whole = (projection.project(points, pose, frame) for points in (masked.points, masked.shape.points))
    planes, features = inpainting.network_inputs(left, pose, len(masked.points))
    occupied, top, bottom = np.split(raster.to_planes(whole), 3)
    return {
        "planes": planes,
        "features": features,
        "occupied": occupied,
        "top": top,
        "bottom": bottom,
        "offset": whole.offset,
        "label": KINDS.index(masked.shape.kind),
    }
