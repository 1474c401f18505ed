"""Makes the data sets: random ones for training, validation and the tests H, far and U, and the paper grid P.

Every cluster has its own random stream, the seed sequence of the set with the number of the cluster as its
spawn key, so a set is the same whatever the number of processes.

Example:
    python -m shipshape_lab.simulator.datasets train --out runs/data --count 20000 --seed 1 --jobs 2
"""

import argparse
import hashlib
import multiprocessing
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape_lab.simulator import recipes
from shipshape_lab.simulator.catalogue import DEFAULT, Catalogue, MeshVessel, read_catalogue, same_vessels
from shipshape_lab.simulator.clusters import ClusterSet, Surfaces, collect, load, load_surfaces, save
from shipshape_lab.simulator.outsiders import OUTSIDER_TYPES, Outsider
from shipshape_lab.simulator.scan import Scan, scan_vessel
from shipshape_lab.simulator.sensor import DEFAULT_LIDAR
from shipshape_lab.simulator.skirt import with_skirt
from shipshape_lab.simulator.strangers import STRANGER_TYPES
from shipshape_lab.simulator.surface import sample_surface
from shipshape_lab.simulator.vessel import Vessel

__all__ = ["Job", "load", "load_surfaces", "main", "make", "make_surfaces"]

MIN_POINTS = 10
MAX_DRAWS = 1000
HULLS_KEPT = 256  # in each process: a real mesh with its search tree takes some 50 MB
DRAWS_OF_A_BAND = 50
SURFACE_POINTS = 20_000
# The grid P has as many as it has cells.
COUNTS = {"train": 40_000, "validation": 5_000, "H": 5_000, "far": 3_000, "U": 3_000}
SEEDS = {"train": 1, "validation": 2, "P": 3, "H": 4, "far": 5, "U": 6}
ABOUT = {
    "train": "what networks learn from",
    "validation": "what calibration and every choice go by",
    "P": "the paper grid: 30 to 110 m, 360 headings, calm",
    "H": "the hard test: ten types, sea, occluders, dropout, three sensors, 30 to 200 m",
    "far": "the catalogue at 110 to 180 m, calm",
    "U": "things and vessels that no model was trained on, scanned as P is",
}


@lru_cache(maxsize=HULLS_KEPT)
def hull(name: str, seed: int, catalogue: Catalogue = DEFAULT) -> Vessel:
    """A hull as the scanner wants it, kept for the next cluster of it."""
    return with_skirt(catalogue.build(name, seed))


@dataclass(frozen=True)
class Job:
    """One set to make: its name, how many clusters, the seed behind all of its chance, and whose clusters.

    `hulls` takes only the first so many hulls of each class, where the recipe has more.
    """

    name: str
    count: int
    seed: int
    catalogue: Catalogue = DEFAULT
    hulls: int | None = None

    def rng(self, i: int) -> np.random.Generator:
        """The random stream of cluster i alone."""
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(i,)))


def random_cluster(job: Job, i: int) -> tuple[Scan, str]:
    """Cluster i of a random set; the type stays, all else is drawn again until there are enough points."""
    recipe, rng = recipes.RECIPES[job.name], job.rng(i)
    name = _draw_class(recipe, job.catalogue, rng)
    for draw in range(MAX_DRAWS):
        # Else far bands would empty towards near ones; but a small craft may never show enough far off.
        if draw % DRAWS_OF_A_BAND == 0:
            band = recipes.draw_band(recipe, rng)
        vessel = hull(name, int(rng.choice(recipe.hulls[: job.hulls])), job.catalogue)
        lidar = recipes.draw_lidar(recipe, rng)
        placement = recipes.draw_placement(band, rng, recipe.sensor_heights)
        conditions = recipes.draw_conditions(recipe, placement, vessel.box[0], rng)
        scan = scan_vessel(vessel, lidar, placement=placement, conditions=conditions, rng=rng)
        if len(scan.points_level) >= MIN_POINTS:
            return scan, lidar.name
    raise ValueError(f"a {name} must show {MIN_POINTS} points within {MAX_DRAWS} draws, but never did")


def _draw_class(recipe: recipes.Recipe, catalogue: Catalogue, rng: np.random.Generator) -> str:
    outsiders = tuple(entry.name for entry in catalogue.outsiders)
    kinds = (catalogue.names, catalogue.others, STRANGER_TYPES, outsiders)
    return str(rng.choice(kinds[rng.choice(len(kinds), p=recipe.shares)]))


def grid_cluster(job: Job, i: int) -> tuple[Scan, str]:
    """Cell i of the paper grid, however few its points."""
    name, distance, heading_deg = recipes.grid_cells(job.catalogue.names)[i]
    vessel = hull(name, grid_hull(name, distance, heading_deg), job.catalogue)
    placement = recipes.grid_placement(distance, heading_deg)
    return scan_vessel(vessel, DEFAULT_LIDAR, placement=placement, rng=job.rng(i)), DEFAULT_LIDAR.name


def grid_hull(name: str, distance: int, heading_deg: int) -> int:
    """Test hull of a cell, spread evenly and the same everywhere (SHA-256 of its coordinates)."""
    digest = hashlib.sha256(f"{name}/{distance}/{heading_deg}".encode()).digest()
    return recipes.TEST_HULLS[int.from_bytes(digest[:8], "big") % len(recipes.TEST_HULLS)]


def make(job: Job, *, jobs: int = 1, progress: bool = True) -> ClusterSet:
    """Makes a set.

    Args:
        job: what to make.
        jobs: processes to share the work; the result does not depend on it.
        progress: whether to show a bar.

    Returns:
        The set, clusters in order.
    """
    cluster = partial(grid_cluster if job.name == "P" else random_cluster, job)
    scans = _spread(cluster, range(job.count), jobs, job.name if progress else None)
    return collect(scans, job.catalogue, job.seed)


def make_surfaces(
    hulls: Iterable[tuple[str, int]],
    catalogue: Catalogue = DEFAULT,
    *,
    jobs: int = 1,
    progress: bool = True,
) -> Surfaces:
    """Samples the complete outer surface of each hull, (class name, seed)."""
    keys = list(hulls)
    points = _spread(partial(_surface, catalogue), keys, jobs, "surfaces" if progress else None)
    names, seeds = zip(*keys, strict=True)
    return Surfaces(np.array(names), np.array(seeds, np.int64), np.stack(points))


def _surface(catalogue: Catalogue, key: tuple[str, int]) -> np.ndarray:
    name, seed = key
    rng = np.random.default_rng([catalogue.classes.index(name), seed])
    return sample_surface(catalogue.build(name, seed), SURFACE_POINTS, rng)


def _spread(function: Callable, items: Sequence, jobs: int, title: str | None) -> list:
    bar = partial(tqdm, total=len(items), desc=title, disable=title is None)
    if jobs == 1:
        return list(bar(map(function, items)))
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        return list(bar(pool.imap(function, items, chunksize=16)))


def summary(clusters: ClusterSet) -> str:
    """A table of clusters and median points by 10 m of distance, one row for each type."""
    steps = np.unique(np.round(clusters.range_m / 10.0).astype(int) * 10)
    lines = ["type".ljust(20) + "clusters".rjust(9) + "".join(f"{s} m".rjust(7) for s in steps)]
    near = np.round(clusters.range_m / 10.0).astype(int) * 10
    for label, name in enumerate(clusters.classes):
        own = clusters.label == label
        if own.any():
            cells = (clusters.n[own & (near == step)] for step in steps)
            medians = "".join((f"{np.median(c):.0f}" if len(c) else "-").rjust(7) for c in cells)
            lines.append(f"{name:<20}{own.sum():>9}{medians}")
    thin = int((clusters.n < MIN_POINTS).sum())
    return "\n".join([*lines, f"{len(clusters)} clusters, {thin} of them with fewer than {MIN_POINTS} points"])


def main(argv: list[str] | None = None) -> None:
    """Command line: makes one set and its surfaces, unless they are there."""
    parser = _parser()
    args = parser.parse_args(argv)
    path = args.out / f"{args.set}.npz"
    try:
        job = _job(args)
        clusters = None if args.force else _made(job, path)
    except ValueError as error:
        parser.error(str(error))
    surfaces = args.out / f"{job.name}_surfaces.npz"
    if clusters is None:
        surfaces.unlink(missing_ok=True)
        clusters = make(job, jobs=args.jobs)
        save(path, clusters)
    if not surfaces.exists():
        pairs = set(zip(clusters.label.tolist(), clusters.hull_seed.tolist(), strict=True))
        hulls = [(job.catalogue.classes[label], seed) for label, seed in sorted(pairs)]
        save(surfaces, make_surfaces(hulls, job.catalogue, jobs=args.jobs))
    print(f"{path}\n{summary(clusters)}")


def _job(args: argparse.Namespace) -> Job:
    catalogue = read_catalogue(args.catalogue) if args.catalogue else DEFAULT
    catalogue.boxes()  # reads every mesh, so that one that cannot be used is told before the work starts
    if args.set == "U":
        catalogue = with_outsiders(catalogue, args.meshes)
    count = args.count or COUNTS.get(args.set) or len(recipes.grid_cells(catalogue.names))
    return Job(args.set, count, SEEDS[args.set] if args.seed is None else args.seed, catalogue, args.hulls)


def with_outsiders(catalogue: Catalogue, meshes: Path | None) -> Catalogue:
    """The catalogue for set U: all generated outsiders, and the real hulls of a folder if one is given.

    Raises:
        ValueError: the folder holds no meshes.
    """
    paths = sorted(meshes.glob("*.ply")) if meshes else []
    if meshes and not paths:
        raise ValueError(f"expected .ply files in {meshes}, got none")
    real = (MeshVessel(path.stem, path.resolve()) for path in paths)
    return replace(catalogue, outsiders=(*map(Outsider, OUTSIDER_TYPES), *real))


def _made(job: Job, path: Path) -> ClusterSet | None:
    if not path.exists():
        return None
    clusters = load(path)
    if not same_vessels(clusters.vessels, job.catalogue.vessels()):
        names = ", ".join(clusters.catalogue)
        raise ValueError(f"{path} must be of the catalogue asked for, but is of {names}: name it, or use --force")
    own = (len(clusters), int(clusters.seed), tuple(clusters.classes))
    return clusters if own == (job.count, job.seed, job.catalogue.classes) else None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m shipshape_lab.simulator.datasets",
        description="Makes a data set of simulated clusters (NAME.npz) and its hulls' complete surfaces.",
        epilog="sets:\n"
        + "\n".join(f"  {name:<12}{text}" for name, text in ABOUT.items())
        + "\n\nexample: python -m shipshape_lab.simulator.datasets train --out runs/data --seed 1 --jobs 2",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("set", choices=tuple(SEEDS), metavar="SET", help=", ".join(SEEDS))
    parser.add_argument("--out", type=Path, required=True, help="folder for the files")
    parser.add_argument("--catalogue", type=Path, help="TOML file of the vessels to know (default: five types)")
    parser.add_argument(
        "--meshes", type=Path, help="U: folder of real hulls (.ply, metres, bow +x) to show beside the generated"
    )
    parser.add_argument("--count", type=int, help="clusters to make; the first ones of the grid for P")
    parser.add_argument("--seed", type=int, help="seed of the set's chance")
    parser.add_argument("--hulls", type=int, help="only the first so many hulls of each class")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--force", action="store_true", help="make it again even if it is there")
    return parser


if __name__ == "__main__":
    main()
