"""A file of arrival times -> a recording.

    seconds,contacts
    0.0,1
    0.504,3

One row a scan: when it was made, in seconds from any origin, ascending, and how many contacts it held, 0 included.
"""

import csv
from pathlib import Path

import numpy as np

from shipshape.errors import FileError
from shipshape.loadtest.arrivals import Arrivals, Recording

COLUMNS = ["seconds", "contacts"]


def read_recording(path: Path) -> Recording:
    """The recording in a file; after its last row it pauses as long as it mostly does between two rows.

    Raises:
        FileError: One sentence that says what was expected and what came.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"expected to read {path.name} as text, got: {error}") from error
    if not rows or [name.strip() for name in rows[0]] != COLUMNS:
        raise FileError(
            f"expected {path.name} to begin with {','.join(COLUMNS)}, got {rows[0] if rows else 'none'}"
        )
    scans = [_scan(row, number, path) for number, row in enumerate(rows[1:], start=2)]
    seconds = np.array([scan[0] for scan in scans], np.float64)
    contacts = np.array([scan[1] for scan in scans], np.int64)
    steps = np.diff(seconds)
    if len(scans) < 2 or steps.min() < 0 or np.median(steps) <= 0 or contacts.sum() == 0:
        raise FileError(f"expected {path.name} to hold scans at ascending times, some with contacts, got others")
    seconds = seconds - seconds[0]
    period_s = float(seconds[-1] + np.median(steps))
    return Recording(Arrivals(seconds[contacts > 0], contacts[contacts > 0]), period_s)


def _scan(row: list[str], number: int, path: Path) -> tuple[float, int]:
    try:
        seconds, contacts = float(row[0]), int(row[1])
    except (ValueError, IndexError):
        seconds, contacts = float("nan"), -1
    if not np.isfinite(seconds) or contacts < 0 or len(row) != len(COLUMNS):
        raise FileError(f"expected a time and a number of contacts in line {number} of {path.name}, got {row}")
    return seconds, contacts
