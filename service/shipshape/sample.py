"""One simulated cluster that travels with the package, for warming up and for the dry run."""

import io
from importlib.resources import files

import numpy as np

from shipshape.types import Contact

SENSOR_HEIGHT = 3.0  # m, of the simulated sensor


def sample_contact() -> Contact:
    """A vessel of the default catalogue, 50 m away."""
    content = files("shipshape").joinpath("sample_cluster.npy").read_bytes()
    points = np.load(io.BytesIO(content), allow_pickle=False)
    return Contact(points, contact_id="sample", sensor_height=SENSOR_HEIGHT)
