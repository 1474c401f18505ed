"""Orthographic images of a cloud: which axis is drawn where, how large a pixel is, and what a layer holds.

Rows run from the top of the picture down, columns from left to right: in the top view the bow is right and
port is up; in the side view the bow is right and up is up. *Depth* is the axis that looks at the viewer
(z in the top view, y in the side view); the layers divide it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Int32, UInt8

from shipshape import kernels


@dataclass(frozen=True, slots=True)
class ImageFrame:
    """Pixel-to-metre transform of an image; all bounds in metres in the frame of the points."""

    axes: tuple[int, int, int]  # which of x, y, z runs along columns, rows and depth
    lower: tuple[float, float, float]  # smallest column, row and depth coordinate inside the image, m
    upper: tuple[float, float, float]  # largest, m
    shape: tuple[int, int]  # rows, columns
    edges: tuple[float, ...]  # layer bounds as shares of the depth range, ascending from 0 to 1

    @property
    def pixel(self) -> tuple[float, float]:
        """Width and height of a pixel, metres."""
        rows, columns = self.shape
        return (self.upper[0] - self.lower[0]) / columns, (self.upper[1] - self.lower[1]) / rows

    @property
    def depth_range(self) -> float:
        """Extent of the depth axis, metres."""
        return self.upper[2] - self.lower[2]


@dataclass(frozen=True, slots=True)
class Layers:
    """What an image holds of a cloud, by layer and cell; depths as shares of the frame's depth range."""

    count: Int32[np.ndarray, "layers rows columns"]
    top: Float32[np.ndarray, "layers rows columns"]  # largest depth, 0 where empty
    bottom: Float32[np.ndarray, "layers rows columns"]  # smallest depth, 0 where empty
    offset: Float32[np.ndarray, "2 layers rows columns"]  # mean position in the cell, pixels from its middle


def rasterise(points: Float32[np.ndarray, "n 3"], frame: ImageFrame) -> Layers:
    """The layers of `frame` filled with `points` (metres, the frame that `frame` speaks of)."""
    width, height = frame.pixel
    start = (frame.lower[0], frame.upper[1], frame.lower[2])
    unit = (width, -height, frame.depth_range)
    edges = np.asarray(frame.edges, np.float32)
    return Layers(*kernels.rasterise(points, frame.axes, start, unit, edges, frame.shape))


def to_metres(
    column: Float32[np.ndarray, " n"],
    row: Float32[np.ndarray, " n"],
    depth: Float32[np.ndarray, " n"],
    frame: ImageFrame,
) -> Float32[np.ndarray, "n 3"]:
    """Points of pixel coordinates (0 = left or upper edge of the image) and depth shares, metres."""
    width, height = frame.pixel
    points = np.empty((len(column), 3), np.float32)
    points[:, frame.axes[0]] = frame.lower[0] + column * width
    points[:, frame.axes[1]] = frame.upper[1] - row * height
    points[:, frame.axes[2]] = frame.lower[2] + depth * frame.depth_range
    return points


# Layer bounds of the aligned image as shares of the length: hull, deck and houses, upper works and masts.
_LAYER_BOUNDS = (0.0, 0.10, 0.22, 0.60)


def aligned_frame(length: float) -> ImageFrame:
    """Top view of the vessel frame, scaled by the vessel's length so that every vessel fills it alike.

    1.2 lengths along by 0.6 across on 64 x 32 square pixels: a pixel is 1.9 % of the length.
    """
    edges = tuple(bound / _LAYER_BOUNDS[-1] for bound in _LAYER_BOUNDS)
    return ImageFrame(
        axes=(0, 1, 2),
        lower=(-0.6 * length, -0.3 * length, 0.0),
        upper=(0.6 * length, 0.3 * length, _LAYER_BOUNDS[-1] * length),
        shape=(32, 64),
        edges=edges,
    )


def to_planes(layers: Layers) -> Float32[np.ndarray, "planes rows columns"]:
    """What a network sees of the layers: occupancy (0 or 1), top and bottom of each layer."""
    return kernels.stack_planes(layers.count, layers.top, layers.bottom)


@dataclass(frozen=True, slots=True)
class FilledLayers:
    """An inpainted image: where the vessel's surface is, by layer and cell."""

    occupied: Bool[np.ndarray, "layers rows columns"]
    top: Float32[np.ndarray, "layers rows columns"]  # share of the frame's depth range
    bottom: Float32[np.ndarray, "layers rows columns"]
    offset: Float32[np.ndarray, "2 layers rows columns"]  # pixels from the cell's middle


def to_grey(
    occupied: Bool[np.ndarray, "3 rows columns"],
    depth: Float32[np.ndarray, "3 rows columns"],
    frame: ImageFrame,
) -> UInt8[np.ndarray, "rows columns 3"]:
    """B G R picture of lower, middle and upper layer: 1..255 from bottom to top of each layer, 0 where empty."""
    return kernels.grey_levels(occupied, depth, np.asarray(frame.edges, np.float32))


def from_grey(
    grey: UInt8[np.ndarray, "rows columns 3"], frame: ImageFrame
) -> Float32[np.ndarray, "3 rows columns"]:
    """Depth shares of a picture made by `to_grey`; meaningless where it is 0."""
    edges = np.asarray(frame.edges, np.float32)[:, None, None]
    share = (grey.transpose(2, 0, 1).astype(np.float32) - 1) / 254
    return edges[:-1] + share * (edges[1:] - edges[:-1])
