"""A catalogue: the vessels that a bundle learns to know, each a type of the generator or a mesh from a file.

A catalogue is read from a small TOML file, one table for each vessel; paths are relative to that file:

    [[vessel]]
    name = "harbour_tug"
    type = "tug"

    [[vessel]]
    name = "ferry_anna"
    mesh = "meshes/anna.stl"
    scale = 0.001        # metres in one unit of the mesh
    waterline = 1.2      # height of the waterline in the mesh's frame after scaling, metres
    bow = "-y"           # the file's axis that points to the bow; x if left out, z in a GLB
    up = "z"             # the file's axis that points up; z if left out, y in a GLB
"""

import math
import tomllib
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
import trimesh

from shipshape.bundle import UNKNOWN, CatalogueVessel
from shipshape.types import ReferenceBox
from shipshape_lab.simulator.mesh_files import AXES, Placing, above_water, read_placed
from shipshape_lab.simulator.outsiders import Outsider
from shipshape_lab.simulator.strangers import STRANGER_TYPES, build_stranger
from shipshape_lab.simulator.vessel import Vessel
from shipshape_lab.simulator.vessels import VESSEL_TYPES, build_vessel

MESH_SPREAD = 0.03  # standard deviation of a mesh's sister hulls along each axis, as a share of its size
CUT_OFF = 2.0  # draws beyond this many deviations are held there
SAME_BOX = 1e-3  # m; boxes closer than this are one


@dataclass(frozen=True)
class GeneratedVessel:
    """A catalogue entry that is one of the generator's types, under a name of its own."""

    name: str
    type: str

    def build(self, seed: int | None) -> Vessel:
        """The nominal hull (None) or a sister hull, as the generator varies it."""
        vessel = build_vessel(self.type, seed)
        return Vessel(self.name, vessel.mesh, seed)


@dataclass(frozen=True)
class MeshVessel:
    """A catalogue entry read from a mesh file, and how its mesh lies in the water."""

    name: str
    mesh: Path
    placing: Placing = field(default_factory=Placing)

    def build(self, seed: int | None) -> Vessel:
        """The file's hull (None), or a sister hull scaled about the origin by 3 % (sd) along each axis.

        A real vessel of a known type differs from its drawing by loading and equipment alone, so its sisters
        lie closer together than those of the generator. The draw depends on the name and the seed.
        """
        nominal = _read_hull(self)
        if seed is None:
            return nominal
        rng = np.random.default_rng([zlib.crc32(self.name.encode()), seed])
        factors = 1.0 + MESH_SPREAD * np.clip(rng.standard_normal(3), -CUT_OFF, CUT_OFF)
        scaled = trimesh.Trimesh(nominal.mesh.vertices * factors, nominal.mesh.faces, process=False)
        return Vessel(self.name, scaled, seed)


@cache
def _read_hull(entry: MeshVessel) -> Vessel:
    return above_water(entry.mesh, read_placed(entry.mesh, entry.placing), name=entry.name)


Entry = GeneratedVessel | MeshVessel


@dataclass(frozen=True)
class Catalogue:
    """Vessels in the order of their class numbers; every type that it neither uses nor names is outside of it.

    Attributes:
        entries: the vessels to be known.
        outsiders: things and vessels that only a test shows; they count as unknown, and no training draws them.
    """

    entries: tuple[Entry, ...]
    outsiders: tuple[Entry | Outsider, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vessels."""
        return tuple(entry.name for entry in self.entries)

    @property
    def others(self) -> tuple[str, ...]:
        """The generator's types outside of the catalogue, which teach what "unknown" looks like."""
        used = {entry.type for entry in self.entries if isinstance(entry, GeneratedVessel)}
        return tuple(name for name in VESSEL_TYPES if name not in used | set(self.names))

    @property
    def classes(self) -> tuple[str, ...]:
        """The catalogue's names, then the types outside of it, then the strangers, then the outsiders."""
        return (*self.names, *self.others, *STRANGER_TYPES, *(entry.name for entry in self.outsiders))

    def build(self, name: str, seed: int | None = None) -> Vessel:
        """One hull of a class, cut at the waterline, in the vessel frame, metres.

        Args:
            name: one of `classes`.
            seed: which sister hull; the same seed gives the same hull. None gives the nominal hull.

        Raises:
            ValueError: the name is not a class, or the vessel's mesh cannot be used.
        """
        entries = {entry.name: entry for entry in (*self.entries, *self.outsiders)}
        if name in entries:
            return entries[name].build(seed)
        if name in STRANGER_TYPES and seed is not None:
            return build_stranger(name, seed)
        return build_vessel(name, seed)

    def boxes(self) -> list[ReferenceBox]:
        """Length, beam and air height of each nominal hull, metres.

        Raises:
            ValueError: a mesh cannot be used.
        """
        return [ReferenceBox(*entry.build(None).box) for entry in self.entries]

    def vessels(self) -> tuple[CatalogueVessel, ...]:
        """Names and boxes, as a bundle lists them."""
        return tuple(map(CatalogueVessel, self.names, self.boxes()))


DEFAULT = Catalogue(
    tuple(GeneratedVessel(name, name) for name in ("rhib", "pilot_boat", "fishing_boat", "tug", "patrol_boat"))
)


def same_vessels(one: Sequence[CatalogueVessel], other: Sequence[CatalogueVessel]) -> bool:
    """Whether two catalogues have the same names in the same order, with boxes equal to 1 mm."""
    if [vessel.name for vessel in one] != [vessel.name for vessel in other]:
        return False
    sizes = [[(v.box.length, v.box.beam, v.box.height) for v in vessels] for vessels in (one, other)]
    return bool(np.allclose(*sizes, rtol=0.0, atol=SAME_BOX))


def read_catalogue(path: Path) -> Catalogue:
    """Reads a catalogue file; its meshes are looked for, but not read yet.

    Raises:
        ValueError: the file is not a catalogue; one sentence says what was expected and what is there.
    """
    entries = []
    for number, table in enumerate(_tables(path), start=1):
        try:
            entries.append(_entry(table, path.parent))
        except ValueError as error:
            raise ValueError(f"{path}: vessel {number} {error}") from None
    catalogue = Catalogue(tuple(entries))
    _check_apart(path, catalogue)
    return catalogue


def _tables(path: Path) -> list[dict]:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} could not be read as a TOML file: {error}") from error
    tables = content.get("vessel")
    if set(content) != {"vessel"} or not isinstance(tables, list) or not tables:
        raise ValueError(f"{path} must hold [[vessel]] tables and nothing else, but holds {sorted(content)}")
    if not all(isinstance(table, dict) for table in tables):
        raise ValueError(f"{path} must describe every vessel in a [[vessel]] table, but some are plain values")
    return tables


def _entry(table: dict, folder: Path) -> Entry:
    name = table.get("name")
    if not isinstance(name, str) or not name.strip() or name == UNKNOWN:
        raise ValueError(f"must have a name other than {UNKNOWN!r}, but has {name!r}")
    if ("type" in table) == ("mesh" in table):
        raise ValueError(f"({name}) must have either a type or a mesh, but has {sorted(table)}")
    expected = {"name", "type"} if "type" in table else {"name", "mesh", "scale", "waterline", "bow", "up"}
    if not set(table) <= expected:
        raise ValueError(f"({name}) may have {sorted(expected)}, but has {sorted(set(table) - expected)} too")
    if "type" in table:
        return GeneratedVessel(name, _type(name, table["type"]))
    mesh = _mesh(name, table["mesh"], folder)
    return MeshVessel(name, mesh, _placing(name, table, mesh.suffix.lower()))


def _placing(name: str, table: dict, suffix: str) -> Placing:
    scale, waterline = _number(table, "scale", 1.0), _number(table, "waterline", 0.0)
    if scale <= 0.0:
        raise ValueError(f"({name}) must have a positive scale, but has {scale}")
    for key in ("bow", "up"):
        if str(table.get(key, "x")) not in AXES:
            raise ValueError(f"({name}) must have one of {', '.join(AXES)} as {key}, but has {table[key]!r}")
    placing = Placing(scale, waterline, table.get("bow"), table.get("up"))
    try:
        placing.rotation(suffix)
    except ValueError as error:
        raise ValueError(f"({name}): {error}") from None
    return placing


def _type(name: str, value: object) -> str:
    if value not in VESSEL_TYPES:
        raise ValueError(f"({name}) must have one of the types {', '.join(VESSEL_TYPES)}, but has {value!r}")
    return str(value)


def _mesh(name: str, value: object, folder: Path) -> Path:
    if not isinstance(value, str) or not (folder / value).is_file():
        raise ValueError(f"({name}) must have a mesh file relative to {folder}, but has {value!r}")
    # The processes that share the work may start elsewhere.
    return (folder / value).resolve()


def _number(table: dict, key: str, default: float) -> float:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"({table['name']}) must have a finite number as {key}, but has {value!r}")
    return float(value)


def _check_apart(path: Path, catalogue: Catalogue) -> None:
    types = [entry.type for entry in catalogue.entries if isinstance(entry, GeneratedVessel)]
    for what, values in (("name", catalogue.names), ("type", types)):
        twice = sorted({value for value in values if values.count(value) > 1})
        if twice:
            raise ValueError(f"{path} must give each vessel a {what} of its own, but has {', '.join(twice)} twice")
    if not catalogue.others:
        raise ValueError(f"{path} must leave out one of the generator's types to be 'unknown', but has them all")
