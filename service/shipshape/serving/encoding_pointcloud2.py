"""The data of a sensor_msgs/PointCloud2 -> points, whatever their order, padding, stride and byte order.

The numbers of the message's own header, which ROS keeps apart from its data, come beside the body as a `Layout`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import Limits, check_points, to_float32

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


def parse_fields(text: str) -> list[PointField]:
    """Fields in the form name:offset:datatype or name:offset:datatype:count, separated by commas.

    Raises:
        InvalidInput: Another form.
    """
    return [_parse_field(entry) for entry in text.split(",")]


def points_from_pointcloud2(data: bytes, layout: Layout, limits: Limits) -> Float32[np.ndarray, "n 3"]:
    """The points of a cloud row by row, level frame, metres; fields other than x, y and z are ignored.

    Raises:
        InvalidInput: No float x, y and z, fields over one another or beyond the point, steps too short, or not as
            many bytes as the steps say.
        TooLarge: More points than the limit, not counting those that are dropped.
    """
    _check_steps(len(data), layout)
    axes = _axes(layout)
    if not data:
        return np.empty((0, 3), np.float32)
    order = ">" if layout.is_bigendian else "<"
    shape, strides = (layout.height, layout.width), (layout.row_step, layout.point_step)
    columns = [
        np.ndarray(shape, order + DATATYPES[axis.datatype], data, axis.offset, strides).ravel() for axis in axes
    ]
    if not layout.is_dense:
        there = np.isfinite(columns[0]) & np.isfinite(columns[1]) & np.isfinite(columns[2])
        columns = [column[there] for column in columns]
    check_points(len(columns[0]), limits)
    return to_float32(np.column_stack(columns))


def _parse_field(entry: str) -> PointField:
    name, *numbers = entry.split(":")
    plain = all(number.isascii() and number.isdigit() and len(number) <= 10 for number in numbers)
    if not name or len(numbers) not in (2, 3) or not plain:
        raise InvalidInput(f"expected fields of the form name:offset:datatype or with :count, got {entry!r:.80}")
    field = PointField(name, *map(int, numbers))
    if field.datatype not in DATATYPES or field.count < 1:
        raise InvalidInput(f"expected a datatype of 1 to 8 and a count above 0 in fields, got {entry!r:.80}")
    return field


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
