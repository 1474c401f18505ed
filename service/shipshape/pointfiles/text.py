"""Text files: a point a line, columns apart by comma, semicolon or blanks, with or without a header."""

import re
from collections.abc import Collection
from pathlib import Path

import numpy as np

from shipshape.errors import FileError
from shipshape.pointfiles.clusters import Cluster, id_name, split_by_id
from shipshape.pointfiles.columns import AXES, as_points, cause, listed

_BOX_SIDES = {"length", "width", "height"}  # beside x, y, z: the middles of detected boxes, not points
_MAX_BYTES = 64 * 2**20  # a line in memory takes several times its length in the file


def read_text(path: Path, max_bytes: int, id_names: Collection[str]) -> list[Cluster]:
    """The clusters of a text file: its columns x, y, z, or the first three when there is no header.

    One cluster, or one of each id where the header names a column of ids.
    """
    if path.stat().st_size > _MAX_BYTES:
        raise FileError(f"expected at most {_MAX_BYTES} bytes of text in {path.name}, got {path.stat().st_size}")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise FileError(f"expected {path.name} to be text in UTF-8, got: {cause(error)}") from error
    lines = [line for line in lines if line.strip() and not _is_comment(line)]
    if not lines:
        raise FileError(f"expected a point a line in {path.name}, got no lines")
    delimiter = next((mark for mark in ";,\t" if mark in lines[0]), None)
    header = [word.strip() for word in lines[0].split(delimiter)]
    named = not any(_is_number(word) for word in header)
    columns = _find_axes(header, path.name) if named else _first_three(header, path.name)
    points = as_points(_parse(lines[named:], delimiter, columns, np.float64, path.name), path.name)
    id_column = _find_ids(header, id_names) if named else None
    if id_column is None:
        return [Cluster(points)]
    ids = _parse(lines[named:], delimiter, [id_column], np.str_, path.name)
    return split_by_id(points, ids[:, 0], path.name)


def _is_comment(line: str) -> bool:
    """A line led by # is a comment, unless it names the columns as some tools do (`# x y z`)."""
    text = line.strip()
    return text.startswith("#") and not set(AXES) <= {_plain(word) for word in re.split(r"[\s,;]+", text)}


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _plain(name: str) -> str:
    """`"X [m]"`, `//X` and `x` are one name."""
    words = re.findall(r"\w+", name.lower())
    return words[0] if words else ""


def _find_axes(header: list[str], what: str) -> list[int]:
    names = [_plain(word) for word in header if word != "#"]
    if not set(AXES) <= set(names):
        raise FileError(f"expected numbers, or a header with the columns x, y, z in {what}, got {listed(header)}")
    if set(names) >= _BOX_SIDES:
        raise FileError(f"expected points in {what}, got a table of boxes, with the columns {listed(header)}")
    return [names.index(axis) for axis in AXES]


def _find_ids(header: list[str], id_names: Collection[str]) -> int | None:
    names = [_plain(word) for word in header if word != "#"]
    named = id_name(names, id_names)
    return None if named is None else names.index(named)


def _first_three(row: list[str], what: str) -> list[int]:
    if len(row) < len(AXES):
        raise FileError(f"expected at least 3 columns in {what}, got {len(row)}")
    return [0, 1, 2]


def _parse(
    lines: list[str], delimiter: str | None, columns: list[int], dtype: type[np.generic], what: str
) -> np.ndarray:
    if not lines:
        raise FileError(f"expected a point a line in {what}, got a header alone")
    try:
        return np.loadtxt(lines, dtype, delimiter=delimiter, usecols=columns, ndmin=2, comments=None)
    except ValueError as error:
        raise FileError(f"expected a number in every x, y, z column of {what}, got: {cause(error)}") from error
