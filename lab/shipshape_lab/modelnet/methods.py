"""The five image methods on everyday shapes, each of stage code of the service: project, inpaint, lift.

Every method is told the pose and the box of the complete shape, as the paper's are by its aligned data set: what
is compared is the images, not the pose. `full_*` scale by the shape's box, `z_*` keep one scale for all shapes.
`best` is the representation of the preset of that name, several surfaces a cell and their place within it, on a
64 x 64 image that is as wide as long: an airplane has a wider beam than a vessel.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from shipshape import raster
from shipshape.onnx_model import OnnxModel
from shipshape.raster import FilledLayers, ImageFrame, Layers
from shipshape.stages import inpainting, lifting, projection
from shipshape.types import ImageMethod, Pose, ReferenceBox
from shipshape_lab.modelnet.record import Record

BEST = "best"
METHODS = (*map(str, ImageMethod), BEST)
_LONGEST = 2.0  # of any shape in the unit sphere: the one scale of `z_*` images
_MARGIN = 1.1  # as projection.paper_frame has it
_THIRDS = (0.0, 1 / 3, 2 / 3, 1.0)


@dataclass(frozen=True)
class Restored:
    """What a method makes of a masked shape: its points (m, 3), and the picture before and after inpainting."""

    points: np.ndarray
    before: np.ndarray  # (64, 64, 3) uint8, B G R
    after: np.ndarray


class Method(Protocol):
    """One way to restore a shape."""

    def restore(self, points: np.ndarray, pose: Pose) -> Restored:
        """The whole shape from what a mask left of it, (n, 3) float32 in the frame of `pose`."""

    def round_trip(self, points: np.ndarray, pose: Pose) -> np.ndarray:
        """A complete shape to an image and back, nothing lost and nothing inpainted: the floor of the method."""


def grey_frame(method: ImageMethod, size: ReferenceBox) -> ImageFrame:
    """The image of one of the paper's methods for a shape of this box."""
    return projection.paper_frame(method, size, _LONGEST)


def layers_frame(size: ReferenceBox) -> ImageFrame:
    """Square top view of `best` for a shape of this box; its three layers divide the box's height."""
    half = _MARGIN * max(size.length, size.beam) / 2
    upper = (half, half, _MARGIN * size.height)
    return ImageFrame((0, 1, 2), (-half, -half, 0.0), upper, (projection.PIXELS, projection.PIXELS), _THIRDS)


def grey_image(points: np.ndarray, pose: Pose, frame: ImageFrame) -> np.ndarray:
    """The paper's picture of a cloud, (64, 64, 3) uint8."""
    layers = projection.project(points, pose, frame)
    return raster.to_grey(layers.count > 0, layers.top, frame)


@dataclass(frozen=True)
class GreyMethod:
    """One of the paper's four methods."""

    method: ImageMethod
    model: OnnxModel
    empty_below: float

    def restore(self, points: np.ndarray, pose: Pose) -> Restored:
        """Every filled pixel of the inpainted picture becomes a point."""
        frame = grey_frame(self.method, pose.size)
        before = grey_image(points, pose, frame)
        after = inpainting.inpaint_grey(before, self.model, empty_below=self.empty_below)
        return Restored(lifting.lift_grey(before, after, pose, frame).points_level, before, after)

    def round_trip(self, points: np.ndarray, pose: Pose) -> np.ndarray:
        """Every filled pixel of the complete shape's picture becomes a point."""
        frame = grey_frame(self.method, pose.size)
        image = grey_image(points, pose, frame)
        return lifting.lift_grey(image, image, pose, frame).points_level


@dataclass(frozen=True)
class LayersMethod:
    """The representation of preset `best`; points that were left stay as they are."""

    model: OnnxModel

    def restore(self, points: np.ndarray, pose: Pose) -> Restored:
        """The points left, and those on the surface that the network says is there."""
        frame = layers_frame(pose.size)
        layers = projection.project(points, pose, frame)
        filled, _ = inpainting.inpaint_layers(layers, pose, len(points), self.model)
        cloud = lifting.lift_layers(points, layers, filled, pose, frame)
        picture = partial(raster.to_grey, frame=frame)
        return Restored(
            cloud.points_level, picture(layers.count > 0, layers.top), picture(filled.occupied, filled.top)
        )

    def round_trip(self, points: np.ndarray, pose: Pose) -> np.ndarray:
        """The surface as the layers of the complete shape hold it, with none of its points kept."""
        frame = layers_frame(pose.size)
        whole = projection.project(points, pose, frame)
        filled = FilledLayers(whole.count > 0, whole.top, whole.bottom, whole.offset)
        nothing = Layers(*map(np.zeros_like, (whole.count, whole.top, whole.bottom, whole.offset)))
        return lifting.lift_layers(np.empty((0, 3), np.float32), nothing, filled, pose, frame).points_level


def load(folder: Path) -> dict[str, Method]:
    """All five methods from what training left in `folder`.

    Raises:
        FileNotFoundError: one of them is not trained yet.
    """
    methods: dict[str, Method] = {}
    for name in METHODS:
        record = Record.read(folder, name)
        model = OnnxModel(folder / f"{name}.onnx")
        methods[name] = (
            LayersMethod(model) if name == BEST else GreyMethod(ImageMethod(name), model, record.empty_below)
        )
    return methods
