"""Ten types of vessel as parametric meshes: `build_vessel(name, seed)`.

Each type is a frozen dataclass of parameters whose defaults are the nominal hull; a seed draws a sister hull.
Vessel frame: x to the bow, y to port, z up, z = 0 on the waterline, origin under the middle of the box.
"""

import numpy as np
import trimesh

from shipshape_lab.simulator.vessel import Vessel
from shipshape_lab.simulator.vessels.fishing_boat import FishingBoat
from shipshape_lab.simulator.vessels.landing_craft import LandingCraft
from shipshape_lab.simulator.vessels.motor_cruiser import MotorCruiser
from shipshape_lab.simulator.vessels.patrol_boat import PatrolBoat
from shipshape_lab.simulator.vessels.pilot_boat import PilotBoat
from shipshape_lab.simulator.vessels.rhib import Rhib
from shipshape_lab.simulator.vessels.sailing_yacht import SailingYacht
from shipshape_lab.simulator.vessels.shape import Shape, above_water
from shipshape_lab.simulator.vessels.small_ferry import SmallFerry
from shipshape_lab.simulator.vessels.tug import Tug
from shipshape_lab.simulator.vessels.usv_catamaran import UsvCatamaran
from shipshape_lab.simulator.vessels.variation import varied

_NOMINAL = {
    "rhib": Rhib(),
    "usv_catamaran": UsvCatamaran(),
    "motor_cruiser": MotorCruiser(),
    "sailing_yacht": SailingYacht(),
    "fishing_boat": FishingBoat(),
    "pilot_boat": PilotBoat(),
    "tug": Tug(),
    "patrol_boat": PatrolBoat(),
    "landing_craft": LandingCraft(),
    "small_ferry": SmallFerry(),
}

VESSEL_TYPES: tuple[str, ...] = tuple(_NOMINAL)
LENGTH_RANGE = (4.5, 30.0)  # m; a sister hull drawn outside is stretched or shortened to fit


def build_vessel(name: str, seed: int | None = None) -> Vessel:
    """One vessel of a type, cut at the waterline.

    Args:
        name: one of `VESSEL_TYPES`.
        seed: which sister hull; the same seed gives the same hull. None gives the nominal hull.

    Returns:
        The vessel, its mesh in the vessel frame in metres, nothing below z = 0, box centred in x and y.

    Raises:
        ValueError: the name is not a vessel type.
    """
    if name not in _NOMINAL:
        raise ValueError(f"Unknown vessel type {name!r}: expected one of {', '.join(VESSEL_TYPES)}.")
    parameters = _NOMINAL[name]
    if seed is not None:
        # The type's own number joins the seed, so that hull 7 of two types do not share their draws.
        parameters = varied(parameters, np.random.default_rng([VESSEL_TYPES.index(name), seed]))
    shape = above_water(parameters.build())
    return Vessel(name, trimesh.Trimesh(_framed(shape), shape.faces, process=False), seed)


def _framed(shape: Shape) -> np.ndarray:
    """The vertices with their box centred in x and y and its length within `LENGTH_RANGE`."""
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    middle = (low + high) / 2 * np.array([1.0, 1.0, 0.0])
    length = high[0] - low[0]
    stretch = np.array([np.clip(length, *LENGTH_RANGE) / length, 1.0, 1.0])
    return (shape.vertices - middle) * stretch
