"""From points to the cells of a layered image and back."""

import numpy as np
from jaxtyping import Float32, Int32, UInt8

from shipshape.kernels.compiled import compiled


@compiled
def rasterise(
    points: Float32[np.ndarray, "n 3"],
    axes: tuple[int, int, int],
    start: tuple[float, float, float],
    unit: tuple[float, float, float],
    edges: Float32[np.ndarray, " layers+1"],
    shape: tuple[int, int],
) -> tuple[
    Int32[np.ndarray, "layers rows columns"],
    Float32[np.ndarray, "layers rows columns"],
    Float32[np.ndarray, "layers rows columns"],
    Float32[np.ndarray, "2 layers rows columns"],
]:
    """Count, highest and lowest depth, and mean sub-cell position of the points in each layer and cell.

    Args:
        points: metres.
        axes: which coordinate runs along columns, rows and depth.
        start: where columns, rows and depth begin, m.
        unit: width of a column, height of a row and the whole depth range, m; negative: the axis runs backwards.
        edges: depths at which the layers start and end, ascending shares of the range; depths outside fall in
            the outer layers.
        shape: rows and columns.

    Returns:
        Counts; highest and lowest depth (0 where empty); mean offset from the cell's middle along columns and
        rows, in pixels, in [-0.5, 0.5]. Points outside the image are left out.
    """
    rows, columns = shape
    layers = len(edges) - 1
    count = np.zeros((layers, rows, columns), np.int32)
    top = np.zeros((layers, rows, columns), np.float32)
    bottom = np.zeros((layers, rows, columns), np.float32)
    offset = np.zeros((2, layers, rows, columns), np.float32)
    start_u, start_v, start_depth = np.float32(start[0]), np.float32(start[1]), np.float32(start[2])
    unit_u, unit_v, unit_depth = np.float32(unit[0]), np.float32(unit[1]), np.float32(unit[2])
    for i in range(len(points)):
        u, v = (points[i, axes[0]] - start_u) / unit_u, (points[i, axes[1]] - start_v) / unit_v
        if not (0 <= u < columns and 0 <= v < rows):
            continue
        depth = (points[i, axes[2]] - start_depth) / unit_depth
        column, row, layer = int(u), int(v), 0
        while layer < layers - 1 and depth >= edges[layer + 1]:
            layer += 1
        seen = count[layer, row, column]
        if seen == 0 or depth > top[layer, row, column]:
            top[layer, row, column] = depth
        if seen == 0 or depth < bottom[layer, row, column]:
            bottom[layer, row, column] = depth
        count[layer, row, column] = seen + 1
        offset[0, layer, row, column] += (u - column - 0.5 - offset[0, layer, row, column]) / (seen + 1)
        offset[1, layer, row, column] += (v - row - 0.5 - offset[1, layer, row, column]) / (seen + 1)
    return count, top, bottom, offset


@compiled
def stack_planes(
    count: Int32[np.ndarray, "layers rows columns"],
    top: Float32[np.ndarray, "layers rows columns"],
    bottom: Float32[np.ndarray, "layers rows columns"],
) -> Float32[np.ndarray, "3*layers rows columns"]:
    """Occupancy (0 or 1), then top and bottom cut to [0, 1], a plane a layer."""
    layers, rows, columns = count.shape
    planes = np.empty((3 * layers, rows, columns), np.float32)
    for layer in range(layers):
        for row in range(rows):
            for column in range(columns):
                planes[layer, row, column] = count[layer, row, column] > 0
                planes[layers + layer, row, column] = min(max(top[layer, row, column], 0), 1)
                planes[2 * layers + layer, row, column] = min(max(bottom[layer, row, column], 0), 1)
    return planes


@compiled
def grey_levels(
    occupied: np.ndarray,  # bool (layers, rows, columns)
    depth: Float32[np.ndarray, "layers rows columns"],
    edges: Float32[np.ndarray, " layers+1"],
) -> UInt8[np.ndarray, "rows columns layers"]:
    """1..255 from the lower to the upper edge of each layer, 0 where it is not occupied."""
    layers, rows, columns = occupied.shape
    grey = np.zeros((rows, columns, layers), np.uint8)
    for layer in range(layers):
        lower, thickness = edges[layer], edges[layer + 1] - edges[layer]
        for row in range(rows):
            for column in range(columns):
                if occupied[layer, row, column]:
                    share = (depth[layer, row, column] - lower) / thickness
                    grey[row, column, layer] = 1 + np.rint(254 * min(max(share, np.float32(0)), np.float32(1)))
    return grey


@compiled
def lift_columns(
    occupied: np.ndarray,  # bool (layers, rows, columns): cells to lift
    surface: tuple[Float32[np.ndarray, "layers rows columns"], Float32[np.ndarray, "layers rows columns"]],
    seen: tuple[
        Int32[np.ndarray, "layers rows columns"],
        Float32[np.ndarray, "layers rows columns"],
        Float32[np.ndarray, "layers rows columns"],
    ],
    offset: Float32[np.ndarray, "2 layers rows columns"],
    step: float,
) -> Float32[np.ndarray, "n 3"]:
    """Points every `step` of depth from bottom to top of each occupied cell, but not where it was measured.

    Args:
        occupied: (layers, rows, columns) bool.
        surface: top and bottom to fill, shares of the depth range.
        seen: how many points were measured, and their top and bottom.
        offset: where in the cell the surface lies, pixels from its middle.
        step: spacing in depth, share of its range.

    Returns:
        (column, row, depth) coordinates; column and row in pixels, 0 at the image's upper left edge.
    """
    layers, rows, columns = occupied.shape
    limit = 0
    for pass_number in range(2):
        lifted = np.empty((limit, 3), np.float32)
        taken = 0
        for layer in range(layers):
            for row in range(rows):
                for column in range(columns):
                    if not occupied[layer, row, column]:
                        continue
                    cell = layer, row, column
                    top, bottom, measured = surface[0][cell], surface[1][cell], seen[0][cell] > 0
                    levels = 1 + max(0, int(np.ceil((top - bottom) / step - 0.5)))
                    for level in range(levels):
                        depth = bottom + (top - bottom) * (level + 0.5) / levels
                        if levels == 1:
                            depth = top
                        if measured and seen[2][cell] - step / 2 <= depth <= seen[1][cell] + step / 2:
                            continue
                        if pass_number == 1:
                            lifted[taken, 0] = column + 0.5 + offset[0, layer, row, column]
                            lifted[taken, 1] = row + 0.5 + offset[1, layer, row, column]
                            lifted[taken, 2] = depth
                        taken += 1
        limit = taken
    return lifted
