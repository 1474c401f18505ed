"""The folder of results. A part that is there is whole, so its parts are the journal of a run.

run.json            what the rows depend on; a folder is of one bundle, one code and one set of options
parts/              the rows of each chunk, written beside and renamed
inputs/             of each input that was read to its end, how many parts it has
clouds/             restored clouds, a file a part, where they are asked for
contacts.parquet    all rows in order      timings.parquet    milliseconds of each of them
summary.json        report.html            changes.parquet    what is new since --compare
"""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import orjson

from shipshape.batch.units import Ending, Part, part_names
from shipshape.errors import FileError, SettingsError

TEMPORARY, LOCK = ".tmp", ".lock"


class Results:
    """A folder of results that belongs to this process while `open_results` runs."""

    def __init__(self, folder: Path, *, clouds: bool) -> None:
        self.folder = folder
        self._clouds = clouds
        for name in ("parts", "inputs", *(["clouds"] if clouds else [])):
            (folder / name).mkdir(parents=True, exist_ok=True)
        for left in folder.rglob(f"*{TEMPORARY}"):  # of a run that was killed while it wrote
            left.unlink()
        self.parts = {path.stem for path in (folder / "parts").glob("*.parquet")}

    def add(self, part: Part) -> None:
        """Keep a part; after this a kill cannot lose it."""
        if part.clouds is not None:  # first: what is journalled must be whole
            write_whole(self.folder / "clouds" / f"{part.name}.parquet", part.clouds)
        write_whole(self.part(part.name), part.table)
        self.parts.add(part.name)

    def close(self, ending: Ending) -> None:
        """Remember how many parts an input has; one that ended with an error is read again another time."""
        if not ending.error:
            counts = {"chunks": ending.chunks, "messages": ending.messages}
            write_whole(self._ending(ending.sha256), orjson.dumps(counts))

    def finished(self, sha256: str) -> Ending | None:
        """How an input ended, when all its parts are there."""
        try:
            ending = Ending(sha256, **orjson.loads(self._ending(sha256).read_bytes()))
        except FileNotFoundError:
            return None
        return ending if all(name in self.parts for name in part_names(sha256, ending.chunks)) else None

    def part(self, name: str) -> Path:
        """The file of a part."""
        return self.folder / "parts" / f"{name}.parquet"

    def _ending(self, sha256: str) -> Path:
        return self.folder / "inputs" / f"{sha256}.json"


@contextmanager
def open_results(folder: Path, identity: dict[str, Any], *, clouds: bool) -> Iterator[Results]:
    """The folder, made if it is not there, for this process alone.

    Args:
        folder: Where it is.
        identity: What the rows depend on: bundle, code, options.
        clouds: Whether restored clouds are written.

    Raises:
        SettingsError: It holds results of another bundle, code or options, or another run works on it.
        FileError: It cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / LOCK).open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise SettingsError(f"expected {folder} to be free, got another run that works on it") from error
            _check_identity(folder, identity)
            yield Results(folder, clouds=clouds)
    except OSError as error:
        raise FileError(f"expected to write into {folder}, got: {error.strerror or error}") from error


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that is whole whenever it is there, though the process or the power fail."""
    beside = path.with_name(f"{path.name}{TEMPORARY}")
    with beside.open("wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
    beside.replace(path)


def _check_identity(folder: Path, identity: dict[str, Any]) -> None:
    path = folder / "run.json"
    wanted = orjson.loads(orjson.dumps(identity))
    if not path.exists():
        if others := {entry.name for entry in folder.iterdir()} - {LOCK, f"{path.name}{TEMPORARY}"}:
            raise SettingsError(f"expected {folder} to be empty or to hold results, got {min(others)} in it")
        write_whole(path, orjson.dumps(wanted, option=orjson.OPT_INDENT_2))
        return
    there = orjson.loads(path.read_bytes())
    for name in [*wanted, *there]:
        if wanted.get(name) != there.get(name):
            raise SettingsError(
                f"expected {folder} to be of the same {name}, {_short(wanted.get(name))}, got results of "
                f"{_short(there.get(name))}: choose another --out, and --compare to see what changes"
            )


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 24 else f"{text[:20]}..."
