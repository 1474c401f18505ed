"""Files of clusters -> one outcome a cluster: a recognition, or the sentence that says why there is none."""

import math
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shipshape.errors import FileError, InvalidInput
from shipshape.pointfiles import read_clusters
from shipshape.types import Contact, Recognition

Recognise = Callable[[Contact], Recognition]  # raises InvalidInput


@dataclass(frozen=True, slots=True)
class Situation:
    """What the caller knows beside the clusters; holds for all of them."""

    sensor_height: float | None = None  # LiDAR above the water, m
    own_true_heading_deg: float | None = None  # clockwise from true north


@dataclass(frozen=True, slots=True)
class Answered:
    """A cluster that was recognised."""

    file: Path
    index: int  # of the cluster in its file
    total: int  # clusters in the file
    contact: Contact
    recognition: Recognition


@dataclass(frozen=True, slots=True)
class Refused:
    """A cluster, or with `index` None a whole file, that was refused."""

    file: Path
    index: int | None
    total: int
    error: str


Outcome = Answered | Refused


def classify_files(files: Iterable[Path], recognise: Recognise, situation: Situation) -> Iterator[Outcome]:
    """The outcome of every cluster in every file, in order; a bad file or cluster does not end the run."""
    for file in files:
        try:
            clusters = read_clusters(file)
        except FileError as error:
            yield Refused(file, None, 0, readable(error))
            continue
        if not clusters:
            yield Refused(file, None, 0, readable(f"expected at least one cluster in {file.name}, got none"))
        for index, points in enumerate(clusters):
            contact = Contact(
                points,
                contact_id=_contact_id(file, index, len(clusters)),
                sensor_height=situation.sensor_height,
                own_true_heading_deg=situation.own_true_heading_deg,
            )
            try:
                yield Answered(file, index, len(clusters), contact, recognise(contact))
            except InvalidInput as error:
                yield Refused(file, index, len(clusters), str(error))


def readable(name: object) -> str:
    """`name` as text that can be printed and sent; a byte of a file name that is no UTF-8 becomes U+FFFD."""
    return os.fsencode(str(name)).decode("utf-8", "replace")


def to_record(outcome: Outcome) -> dict[str, Any]:
    """The outcome as plain values, keys and units as `shipshape classify --help` lists them."""
    source = {"file": readable(outcome.file), "index": outcome.index}
    if isinstance(outcome, Refused):
        return {**source, "error": outcome.error}
    recognition = outcome.recognition
    record = {
        **source,
        "vessel": recognition.vessel,
        "probability": recognition.probability,
        "probabilities": dict(recognition.probabilities),
        "unknown": recognition.unknown,
        "reasons": list(recognition.reasons),
        "heading": recognition.heading,
        "heading_std": recognition.heading_std,
        "bow_probability": recognition.bow_probability,
        "aspect_deg": recognition.aspect_deg,
        "box": _box_record(recognition),
        "measured_points": recognition.measured_points,
        "inferred_points": recognition.inferred_points,
        "rung": recognition.rung,
        "bundle": recognition.bundle,
        "stage_ms": dict(recognition.stage_ms),
    }
    if recognition.true_heading_deg is not None:
        record["true_heading_deg"] = recognition.true_heading_deg
    return record


class PictureFolder:
    """Names for pictures, one a cluster, that never overwrite each other within a run."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._taken: set[str] = set()

    def path(self, answered: Answered) -> Path:
        """`tug.npy` -> `tug.png`; cluster 12 of `scan.npz` -> `scan-0012.png`."""
        stem = _contact_id(answered.file, answered.index, answered.total)
        name, again = stem, 2
        while name in self._taken:
            name, again = f"{stem}_{again}", again + 1
        self._taken.add(name)
        return self._folder / f"{name}.png"


def _contact_id(file: Path, index: int, total: int) -> str:
    stem = readable(file.stem)
    if total == 1:
        return stem
    return f"{stem}-{index:0{max(4, math.ceil(math.log10(total)))}d}"


def _box_record(recognition: Recognition) -> dict[str, Any]:
    box = recognition.box
    return {
        "center": list(box.center_level),
        "length": box.size.length,
        "beam": box.size.beam,
        "height": box.size.height,
    }
