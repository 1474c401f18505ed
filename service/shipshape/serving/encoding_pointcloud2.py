"""The data of a sensor_msgs/PointCloud2 -> points of a contact, within limits; its layout comes in a query."""

import numpy as np
from jaxtyping import Float32

from shipshape.errors import InvalidInput
from shipshape.pointcloud2 import DATATYPES, Layout, PointField, xyz_columns
from shipshape.serving.encoding import Limits, check_points, to_float32

__all__ = ["Layout", "PointField", "parse_fields", "points_from_pointcloud2"]


def parse_fields(text: str) -> list[PointField]:
    """Fields in the form name:offset:datatype or name:offset:datatype:count, separated by commas.

    Raises:
        InvalidInput: Another form.
    """
    return [_parse_field(entry) for entry in text.split(",")]


def points_from_pointcloud2(data: bytes, layout: Layout, limits: Limits) -> Float32[np.ndarray, "n 3"]:
    """The points of a cloud row by row, level frame, metres; fields other than x, y and z are ignored.

    Raises:
        InvalidInput: As `pointcloud2.xyz_columns` says.
        TooLarge: More points than the limit, not counting those that are dropped.
    """
    columns = xyz_columns(data, layout)
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
