"""LAS and LAZ files, of any version and point format; needs laspy, of the extra shipshape[batch]."""

from collections.abc import Collection
from pathlib import Path

import laspy
import numpy as np

from shipshape.errors import FileError
from shipshape.pointfiles.clusters import Cluster, id_name, split_by_id
from shipshape.pointfiles.columns import as_points, cause


def read_las(path: Path, max_bytes: int, id_names: Collection[str]) -> list[Cluster]:
    """The points of the file, scaled and shifted as its header says; a cluster of each id where they have ids."""
    try:
        with laspy.open(path) as reader:
            header = reader.header
            needed = header.point_count * header.point_format.size
            if needed > max_bytes:
                raise FileError(f"expected {path.name} to unpack to at most {max_bytes} bytes, got {needed}")
            cloud = reader.read()
    except FileError:
        raise
    except Exception as error:  # a damaged file makes the parser fail in ways of every kind
        raise FileError(f"expected {path.name} to be a complete LAS file, got: {cause(error)}") from error
    if len(cloud.points) != header.point_count:
        raise FileError(
            f"expected the {header.point_count} points that {path.name} promises, got {len(cloud.points)}"
        )
    named = id_name(list(cloud.point_format.dimension_names), id_names)
    ids = None if named is None else np.asarray(cloud[named])
    return split_by_id(as_points(np.asarray(cloud.xyz), path.name), ids, path.name)
