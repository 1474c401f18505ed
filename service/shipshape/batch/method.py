"""What decides how a row looks, beside input, bundle and code; a folder of results is of one of these."""

from dataclasses import dataclass

from shipshape.pointfiles.clusters import ID_NAMES
from shipshape.types import ImageMethod, Options, Preset, Rung


@dataclass(frozen=True, slots=True)
class Segmentation:
    """How a whole scan is split; `segmentation` says what each number does. Metres."""

    gap: float = 4.0  # points farther apart from above are of two vessels; less parts hull from deckhouse
    water_band: float = 0.5  # above the water, in which nothing is believed
    own_length: float = 20.0  # of the box around the LiDAR, along x, in which everything is one's own vessel
    own_beam: float = 8.0  # of the same, along y
    min_points: int = 10  # what has fewer is spray, a bird or a buoy


@dataclass(frozen=True, slots=True)
class Method:
    """The options of one run."""

    preset: Preset = Preset.BEST
    image_method: ImageMethod = ImageMethod.FULL_SIDE  # used by preset `paper` alone
    sensor_height: float | None = None  # LiDAR above the water, m
    own_true_heading_deg: float | None = None  # clockwise from north
    topics: tuple[str, ...] = ()  # of recordings; none: all of PointCloud2
    id_names: tuple[str, ...] = ID_NAMES  # of the column, field or array that names clusters
    segmentation: Segmentation | None = None  # None: each cloud is one cluster
    restored: bool = False  # write restored clouds too

    @property
    def options(self) -> Options:
        """For the pipeline: always the full answer, nothing is in a hurry."""
        return Options(self.preset, self.image_method, lowest_rung=Rung.FULL)
