"""Spinning LiDARs with 64 channels: where their rays point and which of them come back.

The three presets are modelled on public data sheets (Hesai Pandar64, Ouster OS1-64, Velodyne HDL-64E S3) of
sensors that turn at 10 Hz. They are idealised: no beam divergence, no intensity, one return for each pulse.
Azimuths turn counter-clockwise from x forward, elevations count up from the horizon.
"""

from dataclasses import dataclass

import numpy as np

MOST_GRAZING_COSINE = 1e-3


@dataclass(frozen=True)
class Lidar:
    """One sensor model.

    Attributes:
        name: short name, as saved in data sets.
        elevations_deg: elevation of each channel above the horizon, degrees, shape (64,).
        azimuth_step_deg: turn between two firings of one channel, degrees.
        max_range: no return is reported beyond this range, metres.
        half_range: range from which half of the pulses return off a surface met head-on, metres.
        range_noise_sd: standard deviation of the range error, metres.
    """

    name: str
    elevations_deg: np.ndarray
    azimuth_step_deg: float
    max_range: float
    half_range: float
    range_noise_sd: float

    def directions(
        self, *, azimuth: tuple[float, float], elevation: tuple[float, float], phase: float
    ) -> np.ndarray:
        """Unit vectors of the rays inside an angular window.

        Args:
            azimuth: lowest and highest azimuth, radians; may pass +-pi.
            elevation: lowest and highest elevation, radians.
            phase: offset of the azimuth grid as a share of one step, 0 to 1.

        Returns:
            Directions in the level frame, shape (N, 3), float64.
        """
        step = np.radians(self.azimuth_step_deg)
        first, last = np.ceil(azimuth[0] / step - phase), np.floor(azimuth[1] / step - phase)
        azimuths = (np.arange(first, last + 1) + phase) * step
        elevations = np.radians(self.elevations_deg)
        elevations = elevations[(elevations >= elevation[0]) & (elevations <= elevation[1])]
        turn, lift = (grid.ravel() for grid in np.meshgrid(azimuths, elevations, indexing="ij"))
        return np.column_stack([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])

    def return_probability(self, ranges: np.ndarray, incidence_cosines: np.ndarray) -> np.ndarray:
        """1 - 2^(-cos(incidence) * (half_range / range)^2), and 0 beyond max_range.

        Args:
            ranges: distance to the surface, metres, shape (N,).
            incidence_cosines: cosine between ray and surface normal, 0 to 1, shape (N,).

        Returns:
            Share of pulses that come back, 0 to 1, shape (N,).
        """
        signal = incidence_cosines * (self.half_range / ranges) ** 2
        seen = (ranges <= self.max_range) & (incidence_cosines > MOST_GRAZING_COSINE)
        return np.where(seen, 1.0 - np.exp2(-signal), 0.0)


def _pandar64() -> Lidar:
    dense = 2.0 - np.arange(49) / 6.0
    elevations_deg = np.concatenate([[15.0, 11.0, 8.0, 5.0, 3.0], dense, -np.arange(7.0, 15.0), [-19.0, -25.0]])
    return Lidar("pandar64", elevations_deg, 0.2, max_range=230.0, half_range=200.0, range_noise_sd=0.02)


def _os1_64() -> Lidar:
    elevations_deg = np.linspace(22.5, -22.5, 64)
    return Lidar("os1_64", elevations_deg, 360.0 / 1024, max_range=200.0, half_range=150.0, range_noise_sd=0.03)


def _hdl64e() -> Lidar:
    upper, lower = 2.0 - np.arange(32) / 3.0, -8.83 - np.arange(32) / 2.0
    elevations_deg = np.concatenate([upper, lower])
    return Lidar("hdl64e", elevations_deg, 0.1728, max_range=150.0, half_range=120.0, range_noise_sd=0.02)


PANDAR64 = _pandar64()
OS1_64 = _os1_64()
HDL64E = _hdl64e()
LIDARS = (PANDAR64, OS1_64, HDL64E)
DEFAULT_LIDAR = PANDAR64
