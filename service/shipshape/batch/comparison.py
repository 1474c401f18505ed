"""Two folders of results of the same inputs, row by row: what another bundle, code or set of options changes."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from jaxtyping import Float64

from shipshape.batch.results import TEMPORARY
from shipshape.bundle import UNKNOWN
from shipshape.errors import FileError

COLUMNS = ["unit", "input", "contact_id", "vessel", "unknown", "probability", "heading", "error", "bundle"]
KEPT = ["input", "contact_id"]  # of the new results alone
REFUSED = "refused"
PROBABILITY_SHIFT, HEADING_SHIFT_DEG = 0.1, 5.0  # beyond one of these a row is written down as changed
TURNED_DEG = 90.0  # beyond, bow and stern are taken for one another


@dataclass(frozen=True, slots=True)
class Flip:
    """So many contacts were called one thing and are now called another."""

    old: str
    new: str
    contacts: int


@dataclass(frozen=True, slots=True)
class Comparison:
    """What changed from the old results to the new ones."""

    old_bundle: str
    new_bundle: str
    both: int  # contacts that are in both
    only_old: int
    only_new: int
    flips: list[Flip]  # most first
    probability_shift: dict[str, float]  # percentiles of new - old, of contacts answered in both
    heading_shift_deg: dict[str, float]  # percentiles of the angle between, 0 to 180
    turned: int  # contacts whose bow changed ends
    changed: int  # rows of changes.parquet


def compare(old: Path, new: Path) -> Comparison:
    """Compare two folders of results, and write changes.parquet into the new one.

    Raises:
        FileError: The old one holds none that can be read.
    """
    before, after = _read(old), _read(new)
    joined = after.join(before.drop_columns(KEPT), "unit", right_suffix="_old", join_type="inner")
    joined = joined.sort_by([("input", "ascending"), ("unit", "ascending")])
    was, now = _names(joined, "_old"), _names(joined, "")
    shift = _column(joined, "probability") - _column(joined, "probability_old")
    turn = np.degrees(_column(joined, "heading") - _column(joined, "heading_old"))
    turn = np.abs((turn + 180.0) % 360.0 - 180.0)
    changed = (was != now) | (np.abs(shift) > PROBABILITY_SHIFT) | (turn > HEADING_SHIFT_DEG)
    _write(joined.filter(pa.array(changed)), new / "changes.parquet")
    flips = Counter(zip(was[was != now].tolist(), now[was != now].tolist(), strict=True))
    return Comparison(
        old_bundle=_bundle(before),
        new_bundle=_bundle(after),
        both=len(joined),
        only_old=len(before) - len(joined),
        only_new=len(after) - len(joined),
        flips=[Flip(*names, contacts) for names, contacts in sorted(flips.items(), key=lambda flip: -flip[1])],
        probability_shift=_percentiles(shift),
        heading_shift_deg=_percentiles(turn),
        turned=int(np.count_nonzero(turn > TURNED_DEG)),
        changed=int(changed.sum()),
    )


def _read(folder: Path) -> pa.Table:
    try:
        return pq.read_table(folder / "contacts.parquet", columns=COLUMNS)
    except (pa.ArrowException, OSError) as error:
        raise FileError(f"expected results in {folder}, got no contacts.parquet that can be read") from error


def _names(table: pa.Table, suffix: str) -> np.ndarray:
    """What each contact is called: a vessel, unknown, or refused."""
    named = pc.if_else(table[f"unknown{suffix}"], UNKNOWN, table[f"vessel{suffix}"])
    return np.asarray(pc.fill_null(named, REFUSED).to_numpy(zero_copy_only=False), np.str_)


def _column(table: pa.Table, name: str) -> Float64[np.ndarray, " n"]:
    return np.asarray(pc.fill_null(table[name], np.nan).to_numpy(), np.float64)


def _percentiles(values: Float64[np.ndarray, " n"]) -> dict[str, float]:
    known = values[np.isfinite(values)]
    if not len(known):
        return {}
    return {f"p{percent}": float(np.percentile(known, percent)) for percent in (1, 10, 50, 90, 99)}


def _bundle(table: pa.Table) -> str:
    return ", ".join(sorted(set(pc.unique(table["bundle"]).to_pylist())))


def _write(table: pa.Table, path: Path) -> None:
    beside = path.with_name(f"{path.name}{TEMPORARY}")
    pq.write_table(table, beside, compression="zstd")
    beside.replace(path)
