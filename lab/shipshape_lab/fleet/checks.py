"""The checks of a whole catalogue: each mesh on its own, then every two vessels against each other."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from tqdm import tqdm

from shipshape_lab.fleet.mesh_checks import Finding, check_mesh
from shipshape_lab.metrics import CompleteSurface, chamfer_l1
from shipshape_lab.simulator.catalogue import Catalogue, MeshVessel
from shipshape_lab.simulator.surface import sample_surface
from shipshape_lab.simulator.vessel import Vessel

SURFACE_POINTS = 3000
# CD-L1 over the longer length. Sisters of one mesh come to 0.012, half of it the spacing of the points.
ALIKE = 0.02


def check_catalogue(catalogue: Catalogue) -> list[Finding]:
    """Everything that is wrong or odd about the catalogue's vessels, in their order; pairs come last."""
    found: list[Finding] = []
    hulls = []
    for entry in tqdm(catalogue.entries, desc="check meshes", leave=False):
        own, vessel = check_mesh(entry) if isinstance(entry, MeshVessel) else ([], entry.build(None))
        found += own
        hulls += [vessel] if vessel else []
    return [*found, *_alike(hulls)]


def _alike(hulls: Sequence[Vessel]) -> Iterator[Finding]:
    clouds = [sample_surface(hull, SURFACE_POINTS, np.random.default_rng(0)) for hull in hulls]
    for (one, first), (other, second) in combinations(zip(hulls, clouds, strict=True), 2):
        length = max(one.box[0], other.box[0])
        if abs(one.box[0] - other.box[0]) > 0.2 * length:
            continue
        apart = chamfer_l1(CompleteSurface(first, length).nearest(second))
        if apart < ALIKE:
            text = (
                f"and {other.name} differ by {apart * length:.2f} m on average: they may be taken for each other"
            )
            yield Finding(one.name, f"{text}, so keep one of them if a confusion matters")
