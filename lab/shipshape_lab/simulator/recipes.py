"""What each data set is made of: which hulls, distances, headings, sensors and conditions.

Three rules keep what a model learns from apart from what it is tested on: the hull seeds of the splits are
disjoint, drawn ranges stay 0.5 m away from multiples of 10 m, and drawn headings stay 0.1 degrees away from
whole degrees, where the paper grid lies.
"""

from dataclasses import dataclass, replace

import numpy as np

from shipshape_lab.simulator.occluders import BoxOccluder
from shipshape_lab.simulator.scan import Conditions
from shipshape_lab.simulator.sea import MODERATE_SEA, Placement, SeaState
from shipshape_lab.simulator.sensor import DEFAULT_LIDAR, HDL64E, OS1_64, PANDAR64, Lidar

TRAIN_HULLS = range(0, 120)
VALIDATION_HULLS = range(1000, 1012)
TEST_HULLS = range(2000, 2012)

GRID_DISTANCES = range(30, 111, 10)
GRID_HEADINGS_DEG = range(360)
GRID_SENSOR_HEIGHT = 3.0

RANGE_GAP = 0.5
HEADING_GAP_DEG = 0.1


@dataclass(frozen=True)
class Recipe:
    """How clusters of a random set are drawn.

    Attributes:
        hulls: seeds of hull variations to pick from.
        bands: (share, nearest, farthest) of the ranges, metres.
        shares: of clusters that show a vessel of the catalogue, a type outside of it, a stranger, and an outsider.
        lidars: (share, sensor).
        sensor_heights: lowest and highest above the water, metres.
        sea: the sea in half of the clusters; the other half is calm. None for a calm sea in all.
        occluded_share: share of clusters behind an occluder.
        max_dropout: dropout is uniform from 0 to this.
    """

    hulls: range
    bands: tuple[tuple[float, float, float], ...] = ((0.65, 25.0, 125.0), (0.35, 125.0, 200.0))
    shares: tuple[float, float, float, float] = (0.65, 0.23, 0.12, 0.0)
    lidars: tuple[tuple[float, Lidar], ...] = ((0.6, PANDAR64), (0.2, OS1_64), (0.2, HDL64E))
    sensor_heights: tuple[float, float] = (2.0, 6.0)
    sea: SeaState | None = MODERATE_SEA
    occluded_share: float = 0.2
    max_dropout: float = 0.25


# As the paper grid is scanned, but off its distances and headings.
CALM_TEST = Recipe(
    TEST_HULLS,
    lidars=((1.0, DEFAULT_LIDAR),),
    sensor_heights=(GRID_SENSOR_HEIGHT, GRID_SENSOR_HEIGHT),
    sea=None,
    occluded_share=0.0,
    max_dropout=0.0,
)

RECIPES = {
    "train": Recipe(TRAIN_HULLS),
    "validation": Recipe(VALIDATION_HULLS),
    "H": Recipe(
        TEST_HULLS,
        bands=((1.0, 30.0, 200.0),),
        shares=(0.5, 0.5, 0.0, 0.0),
        occluded_share=0.3,
        max_dropout=0.3,
    ),
    "far": replace(CALM_TEST, bands=((1.0, 110.0, 180.0),), shares=(1.0, 0.0, 0.0, 0.0)),
    # The ranges and conditions of P, so that known and unknown differ by what they are and by nothing else.
    "U": replace(CALM_TEST, bands=((1.0, 30.0, 110.0),), shares=(0.0, 0.0, 0.0, 1.0)),
}


def draw_lidar(recipe: Recipe, rng: np.random.Generator) -> Lidar:
    """One of the recipe's sensors."""
    shares, lidars = zip(*recipe.lidars, strict=True)
    return lidars[rng.choice(len(lidars), p=shares)]


def draw_band(recipe: Recipe, rng: np.random.Generator) -> tuple[float, float]:
    """Nearest and farthest range of one of the recipe's bands, metres."""
    band = rng.choice(len(recipe.bands), p=[share for share, _, _ in recipe.bands])
    _, nearest, farthest = recipe.bands[band]
    return nearest, farthest


def draw_range(band: tuple[float, float], rng: np.random.Generator) -> float:
    """Distance in metres, in a band, off the distances of the paper grid."""
    nearest, farthest = band
    while True:
        range_m = rng.uniform(nearest, farthest)
        if abs(range_m - 10.0 * round(range_m / 10.0)) > RANGE_GAP:
            return range_m


def draw_heading(rng: np.random.Generator) -> float:
    """Heading in radians, in (-pi, pi], off the whole degrees of the paper grid."""
    whole = rng.integers(-180, 180)
    return float(np.radians(whole + rng.uniform(HEADING_GAP_DEG * 1.01, 1.0 - HEADING_GAP_DEG * 1.01)))


def draw_placement(
    band: tuple[float, float], rng: np.random.Generator, sensor_heights: tuple[float, float] = (2.0, 6.0)
) -> Placement:
    """A range in the band, any bearing, a sensor between two heights above the water, metres."""
    return Placement(
        range_m=draw_range(band, rng),
        heading=draw_heading(rng),
        bearing=float(rng.uniform(-np.pi, np.pi)),
        sensor_height=float(rng.uniform(*sensor_heights)),
    )


def draw_conditions(recipe: Recipe, placement: Placement, length: float, rng: np.random.Generator) -> Conditions:
    """Sea, dropout and now and then a box in front of a hull of this length (metres)."""
    sea = recipe.sea if rng.random() < 0.5 else None
    occluded = rng.random() < recipe.occluded_share
    occluders = (draw_box(placement, length, rng),) if occluded else ()
    return Conditions(sea=sea, occluders=occluders, dropout=float(rng.uniform(0.0, recipe.max_dropout)))


def draw_box(placement: Placement, length: float, rng: np.random.Generator) -> BoxOccluder:
    """A quay, buoy or boat at 30 to 70 % of the way, up to half as wide as the hull looks, on the water."""
    way = rng.uniform(0.3, 0.7)
    side = way * length * rng.uniform(-0.5, 0.5)
    half = way * length * rng.uniform(0.05, 0.25)
    cosine, sine = np.cos(placement.bearing), np.sin(placement.bearing)
    x = way * placement.range_m * cosine - side * sine
    y = way * placement.range_m * sine + side * cosine
    bottom = -placement.sensor_height
    top = bottom + rng.uniform(0.5, placement.sensor_height + 3.0)
    return BoxOccluder(low=(x - half, y - half, bottom), high=(x + half, y + half, top))


def grid_cells(catalogue: tuple[str, ...]) -> list[tuple[str, int, int]]:
    """(type, distance in metres, heading in degrees) of the paper grid, in the order of its file."""
    return [(n, d, h) for n in catalogue for d in GRID_DISTANCES for h in GRID_HEADINGS_DEG]


def grid_placement(distance: int, heading_deg: int) -> Placement:
    """A grid cell's placement: bearing 0, heading brought to (-pi, pi]."""
    turned = heading_deg if heading_deg <= 180 else heading_deg - 360
    return Placement(float(distance), float(np.radians(turned)), 0.0, GRID_SENSOR_HEIGHT)
