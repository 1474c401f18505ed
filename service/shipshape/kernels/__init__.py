"""Compiled inner loops (numba): they release the GIL, so that worker threads scale with cores.

Compiled code is cached on disk; the first call in a fresh environment compiles, `warm_up` of the service pays for
it before the service is ready. Arrays are contiguous: a strided one would be compiled for once more.
"""

from shipshape.kernels.clouds import Extent, extent, into_frame, out_of_frame
from shipshape.kernels.groups import describe_groups, farthest_points, in_ball
from shipshape.kernels.images import grey_levels, lift_columns, rasterise, stack_planes
from shipshape.kernels.neighbours import count_neighbours, select_spread
from shipshape.kernels.silhouette import missing_share
from shipshape.kernels.sphere import bin_spherically

__all__ = [
    "Extent",
    "bin_spherically",
    "count_neighbours",
    "describe_groups",
    "extent",
    "farthest_points",
    "grey_levels",
    "in_ball",
    "into_frame",
    "lift_columns",
    "missing_share",
    "out_of_frame",
    "rasterise",
    "select_spread",
    "stack_planes",
]
