"""The data of a sensor_msgs/PointCloud2 -> its columns, whatever their order, padding, stride and byte order.

The numbers of the message's own header, which ROS keeps apart from its data, come beside the data as a `Layout`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shipshape.errors import InvalidInput

# sensor_msgs/PointField.datatype
DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
FLOATS = (7, 8)


@dataclass(frozen=True, slots=True)
class PointField:
    """One field of a point, as sensor_msgs/PointField has it."""

    name: str
    offset: int  # bytes from the start of the point
    datatype: int  # a key of DATATYPES
    count: int = 1

    @property
    def end(self) -> int:
        """The first byte after it."""
        return self.offset + self.count * np.dtype(DATATYPES[self.datatype]).itemsize


@dataclass(frozen=True, slots=True)
class Layout:
    """How the points lie in the data, in the words of sensor_msgs/PointCloud2; no number is negative."""

    fields: Sequence[PointField]
    width: int  # points a row
    height: int  # rows
    point_step: int  # bytes from point to point
    row_step: int  # bytes from row to row
    is_bigendian: bool = False
    is_dense: bool = True  # false: points that are not finite stand for no point and are dropped


def xyz_columns(data: bytes | np.ndarray, layout: Layout) -> list[np.ndarray]:
    """The columns x, y and z of all points row by row, floats as they came; metres.

    Raises:
        InvalidInput: No float x, y and z, fields over one another or beyond the point, steps too short, or not as
            many bytes as the steps say.
    """
    _check_steps(len(data), layout)
    return [column(data, layout, axis) for axis in _axes(layout)]


def column(data: bytes | np.ndarray, layout: Layout, field: PointField) -> np.ndarray:
    """One field of all points row by row, of a layout that `xyz_columns` takes."""
    dtype = (">" if layout.is_bigendian else "<") + DATATYPES[field.datatype]
    if not len(data):
        return np.empty(0, dtype)
    shape, strides = (layout.height, layout.width), (layout.row_step, layout.point_step)
    return np.ndarray(shape, dtype, data, field.offset, strides).ravel()


def _check_steps(size: int, layout: Layout) -> None:
    if layout.point_step < 1:
        raise InvalidInput("expected a point_step above 0, got 0")
    if layout.row_step < layout.width * layout.point_step:
        raise InvalidInput(
            f"expected a row_step of at least width x point_step = {layout.width * layout.point_step}, "
            f"got {layout.row_step}"
        )
    if size != layout.height * layout.row_step:
        raise InvalidInput(
            f"expected height x row_step = {layout.height * layout.row_step} bytes of points, got {size}"
        )


def _axes(layout: Layout) -> list[PointField]:
    """The fields x, y and z, each within the point and apart from every other field."""
    axes = [field for field in layout.fields if field.name in ("x", "y", "z")]
    axes.sort(key=lambda field: field.name)
    if [field.name for field in axes] != ["x", "y", "z"]:
        names = ", ".join(field.name for field in layout.fields)
        raise InvalidInput(f"expected one field each of x, y and z, got {names or 'none':.80}")
    for axis in axes:
        if axis.datatype not in FLOATS or axis.count != 1:
            raise InvalidInput(f"expected {axis.name} as one float32 (7) or float64 (8), got {_text(axis)}")
    for field in layout.fields:
        if field.end > layout.point_step:
            raise InvalidInput(f"expected fields within a point_step of {layout.point_step}, got {_text(field)}")
        for axis in axes:
            if field is not axis and field.offset < axis.end and axis.offset < field.end:
                raise InvalidInput(f"expected {axis.name} apart from other fields, got {_text(field)} over it")
    return axes


def _text(field: PointField) -> str:
    return f"{field.name:.40}:{field.offset}:{field.datatype}:{field.count}"
