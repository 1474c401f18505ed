"""Parquet files, a row a point or a row a cluster; needs pyarrow, of the extra shipshape[batch]."""

from collections.abc import Collection
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from shipshape.errors import FileError
from shipshape.pointfiles.clusters import MAX_CLUSTERS, Cluster, id_name, id_text, split_by_id
from shipshape.pointfiles.columns import AXES, as_points, cause, listed

VALUE_BYTES = 4  # of a coordinate, as a reader's points hold it


def read_parquet(path: Path, max_bytes: int, id_names: Collection[str]) -> list[Cluster]:
    """The clusters in the columns x, y and z: lists are a cluster a row; of numbers, each id is a cluster."""
    try:
        with pq.ParquetFile(path) as file:
            names = file.schema_arrow.names
            named = id_name(names, id_names)
            table = _read(file, named, max_bytes, path.name)
    except (pa.ArrowException, OSError) as error:
        raise FileError(f"expected {path.name} to be a complete Parquet file, got: {cause(error)}") from error
    columns = [table[axis].combine_chunks() for axis in AXES]
    ids = None if named is None else table[named].to_pylist()
    if all(pa.types.is_list(column.type) or pa.types.is_large_list(column.type) for column in columns):
        return _a_row_a_cluster(columns, ids, path.name)
    points = as_points(np.column_stack([_numbers(column, path.name) for column in columns]), path.name)
    texts = None if ids is None else np.array([id_text(value) for value in ids], np.str_)
    return split_by_id(points, texts, path.name)


def _read(file: pq.ParquetFile, named: str | None, max_bytes: int, what: str) -> pa.Table:
    names = file.schema_arrow.names
    if not set(AXES) <= set(names):
        raise FileError(f"expected the columns x, y, z in {what}, got {listed(names)}")
    groups = [file.metadata.row_group(index) for index in range(file.metadata.num_row_groups)]
    # What is all alike takes next to nothing in the file, however many values it is.
    needed = max(sum(group.total_byte_size for group in groups), VALUE_BYTES * sum(map(_values, groups)))
    if needed > max_bytes:
        raise FileError(f"expected {what} to unpack to at most {max_bytes} bytes, got {needed}")
    return file.read([*AXES, *([named] if named else [])])


def _values(group: pq.RowGroupMetaData) -> int:
    columns = (group.column(index) for index in range(group.num_columns))
    return sum(column.num_values for column in columns if column.path_in_schema.split(".")[0] in AXES)


def _a_row_a_cluster(columns: list[pa.Array], ids: list[object] | None, what: str) -> list[Cluster]:
    rows = len(columns[0])
    if rows > MAX_CLUSTERS:
        raise FileError(f"expected at most {MAX_CLUSTERS} clusters in {what}, got {rows}")
    clusters = []
    for row in range(rows):
        cells = [column[row] for column in columns]
        axes = [_numbers(cell.values if cell.is_valid else pa.array([]), what) for cell in cells]
        if len({len(axis) for axis in axes}) != 1:
            raise FileError(f"expected as many y and z as x in row {row} of {what}, got {[len(a) for a in axes]}")
        name = "" if ids is None else id_text(ids[row])
        clusters.append(Cluster(as_points(np.column_stack(axes), what), name, apart=True))
    return clusters


def _numbers(column: pa.Array, what: str) -> np.ndarray:
    if not (pa.types.is_floating(column.type) or pa.types.is_null(column.type)):
        raise FileError(f"expected floats in x, y and z of {what}, got {column.type}")
    return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False))
