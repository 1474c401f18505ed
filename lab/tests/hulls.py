"""Hulls whose scans can be worked out on paper."""

import numpy as np
import trimesh

from shipshape_lab.simulator.sensor import PANDAR64, Lidar
from shipshape_lab.simulator.vessel import Vessel


def box_hull(length=20.0, beam=6.0, height=4.0) -> Vessel:
    mesh = trimesh.creation.box(extents=(length, beam, height))
    mesh.apply_translation([0.0, 0.0, height / 2])
    return Vessel("box", mesh)


def perfect_lidar(noise_sd=0.0) -> Lidar:
    """Reports every pulse that meets something."""
    return Lidar("perfect", PANDAR64.elevations_deg, 0.2, np.inf, 1e9, noise_sd)


def to_vessel(T_level_vessel, points_level):
    return (points_level - T_level_vessel[:3, 3]) @ T_level_vessel[:3, :3]
