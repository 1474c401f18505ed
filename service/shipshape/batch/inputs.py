"""INPUT... -> files and folders of recordings, each content once, and the record of what became of each."""

import hashlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from shipshape.batch.units import Source
from shipshape.pointfiles import SUFFIXES as FILES
from shipshape.pointfiles.recordings import SUFFIXES as RECORDINGS
from shipshape.pointfiles.recordings import is_recording


@dataclass(slots=True)
class InputRecord:
    """What became of one input."""

    name: str
    size: int = 0  # bytes
    sha256: str = ""
    messages: int = 0  # clouds that were read from it
    chunks: int = 0
    contacts: int = 0
    refused: int = 0  # of its contacts
    error: str = ""  # why it was refused, or was not read to its end
    same_as: str = ""  # name of an input of the same content, which has the rows


class Inputs:
    """The inputs of one run, in its order.

    Attributes:
        hashing: Name of the one that is read for its digest just now: a large one takes a while; else empty.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = list(paths)
        self.records = [InputRecord(shown(path)) for path in self._paths]
        for path, record in zip(self._paths, self.records, strict=True):
            try:
                record.size = _size(path)
            except OSError as error:
                record.error = f"expected to read {record.name}, got: {error.strerror or error}"
        self.hashing = ""
        self._of: dict[str, InputRecord] = {}

    @property
    def size(self) -> int:
        """Bytes of them all."""
        return sum(record.size for record in self.records)

    def sources(self) -> Iterator[Source]:
        """Those that can be read, each when its turn comes, with its digest; what is a copy comes once."""
        for path, record in zip(self._paths, self.records, strict=True):
            if record.error:
                continue
            # First: of two names for one content, it may be the wrong one.
            if not (path.is_dir() or _is_known(path)):
                record.error = f"expected a file ending in {' '.join([*FILES, *RECORDINGS])}, got {path.name}"
                continue
            try:
                self.hashing = record.name
                record.sha256 = _digest(path)
            except OSError as error:
                record.error = f"expected to read {record.name}, got: {error.strerror or error}"
                continue
            finally:
                self.hashing = ""
            first = self._of.setdefault(record.sha256, record)
            if first is not record:
                record.same_as = first.name
                continue
            yield Source(path, record.sha256, record.size)

    def of(self, sha256: str) -> InputRecord:
        """The record of the input of that content."""
        return self._of[sha256]


def find_inputs(given: Sequence[Path], out: Path) -> list[Path]:
    """Files as they are given, and in folders all of known kinds, sorted; a folder of a ROS 2 bag is one input.

    A folder is searched once, however many links lead to it.

    Args:
        given: Files and folders.
        out: The folder of results, which is no input.
    """
    found: list[Path] = []
    searched = {out.resolve()}
    for path in given:
        found.extend(_within(path, searched) if path.is_dir() and not is_recording(path) else [path])
    return list(dict.fromkeys(found))


def shown(path: Path) -> str:
    """The path as text; a byte that is no UTF-8 becomes U+FFFD."""
    return os.fsencode(str(path)).decode("utf-8", "replace")


def _within(folder: Path, searched: set[Path]) -> Iterator[Path]:
    if (place := folder.resolve()) in searched:
        return
    searched.add(place)
    try:
        entries = sorted(folder.iterdir())
    except OSError:  # it becomes an input, so that its refusal is told with all others
        yield folder
        return
    for entry in entries:
        if entry.is_dir() and not is_recording(entry):
            yield from _within(entry, searched)
        elif entry.is_dir() or _is_known(entry):
            yield entry


def _is_known(path: Path) -> bool:
    return path.suffix.lower() in {*FILES, *RECORDINGS}


def _files(path: Path) -> list[Path]:
    return sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]


def _size(path: Path) -> int:
    if path.exists() and not (path.is_file() or path.is_dir()):  # a pipe would be waited for, a device never ends
        raise OSError("something that is neither file nor folder")
    return sum(file.stat().st_size for file in _files(path))


def _digest(path: Path) -> str:
    """sha256 of a file; of a folder, that of its files' names and digests."""
    files = _files(path)
    digests = [_digest_of_file(file) for file in files]
    if not path.is_dir():
        return digests[0]
    lines = [f"{digest} {file.relative_to(path)}" for digest, file in zip(digests, files, strict=True)]
    return hashlib.sha256("\n".join(lines).encode("utf-8", "surrogateescape")).hexdigest()


def _digest_of_file(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
