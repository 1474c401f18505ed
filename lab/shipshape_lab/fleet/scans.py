"""Scans that no training shows: the catalogue's nominal hulls at the paper's distances, and what is not in it.

Training draws sister hulls, never the nominal ones, and its ranges and headings keep off multiples of 10 m and
whole degrees (`recipes`), where these scans lie.
"""

import numpy as np
from tqdm import tqdm

from shipshape_lab.simulator import datasets, recipes
from shipshape_lab.simulator.catalogue import Catalogue
from shipshape_lab.simulator.clusters import ClusterSet, collect
from shipshape_lab.simulator.scan import Scan, scan_vessel
from shipshape_lab.simulator.sensor import DEFAULT_LIDAR
from shipshape_lab.simulator.skirt import with_skirt
from shipshape_lab.simulator.strangers import STRANGER_TYPES
from shipshape_lab.simulator.vessel import Vessel

HEADINGS_DEG = range(0, 360, 9)
UNKNOWN_HULLS = 60  # hulls outside of the catalogue, spread over its types
UNKNOWN_SCANS = 12  # of each of them
HARD = 2_000  # clusters, half of them of the catalogue
SEED = 11


def calm(catalogue: Catalogue) -> ClusterSet:
    """Every vessel at 30 to 110 m in 40 headings, then strangers at drawn places of the same kind; all calm."""
    rng = np.random.default_rng(SEED)
    scans = []
    for name in tqdm(catalogue.names, desc="scan the catalogue"):
        vessel = with_skirt(catalogue.build(name))
        scans += [_scan(vessel, d, h, rng) for d in recipes.GRID_DISTANCES for h in HEADINGS_DEG]
    others = (*catalogue.others, *STRANGER_TYPES)
    for i in tqdm(range(UNKNOWN_HULLS), desc="scan the unknown"):
        seed = recipes.TEST_HULLS[i // len(others) % len(recipes.TEST_HULLS)]
        vessel = with_skirt(catalogue.build(others[i % len(others)], seed))
        places = zip(
            rng.choice(recipes.GRID_DISTANCES, UNKNOWN_SCANS), rng.choice(360, UNKNOWN_SCANS), strict=True
        )
        scans += [_scan(vessel, int(d), int(h), rng) for d, h in places]
    return collect([(scan, DEFAULT_LIDAR.name) for scan in scans], catalogue, SEED)


def hard(catalogue: Catalogue) -> ClusterSet:
    """Set H of the catalogue: sister hulls and others in a sea, occluded, thinned, by three sensors, to 200 m."""
    return datasets.make(datasets.Job("H", HARD, SEED, catalogue))


def _scan(vessel: Vessel, distance: int, heading_deg: int, rng: np.random.Generator) -> Scan:
    placement = recipes.grid_placement(distance, heading_deg)
    return scan_vessel(vessel, DEFAULT_LIDAR, placement=placement, rng=rng)
