"""What every system said of every cluster of a set, beside the truth; kept as plain arrays in .npz.

The file names what the set and each system's answers were computed from, so that a run can go on where it was
stopped, and only the systems that changed are asked again.
"""

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

REFUSED = -1


@dataclass(frozen=True)
class Truth:
    """What is true of M clusters, one entry a cluster, and the key of what they were computed from.

    Attributes:
        key: digest of the set, and the options of the run.
        index: number of each cluster in its set.
        label: index into the bundle's catalogue; its length stands for everything outside of it.
        kind: name of the type, unicode.
        lidar: name of the sensor, unicode.
        hidden_share: share of the returns that occluders took away, NaN where it was not recorded.
        range_m: distance, metres.
        aspect_deg: 0 bow-on to 180 stern-on.
        heading: radians.
        center: middle of the vessel, level frame, (M, 2), metres.
        size: length, beam, height, (M, 3), metres.
        points: how many points the cluster has.
    """

    key: np.ndarray
    index: np.ndarray
    label: np.ndarray
    kind: np.ndarray
    lidar: np.ndarray
    hidden_share: np.ndarray
    range_m: np.ndarray
    aspect_deg: np.ndarray
    heading: np.ndarray
    center: np.ndarray
    size: np.ndarray
    points: np.ndarray


@dataclass(frozen=True)
class Answers:
    """What S systems said of M clusters, K vessels and "unknown"; NaN where a system says nothing of the kind.

    Attributes:
        system: names of the systems, (S,).
        key: what each system was: digest of the bundle or of the peers' files, (S,).
        done: whether the cluster was put to the system yet, (S, M).
        probabilities: of each vessel and of "unknown", (S, M, K + 1); NaN where the cluster was refused.
        unknown: whether the system would rather call it unknown, (S, M).
        heading: radians, (S, M).
        heading_std: radians, (S, M).
        bow_probability: (S, M).
        center: (S, M, 2), metres, level frame.
        size: (S, M, 3), metres.
    """

    system: np.ndarray
    key: np.ndarray
    done: np.ndarray
    probabilities: np.ndarray
    unknown: np.ndarray
    heading: np.ndarray
    heading_std: np.ndarray
    bow_probability: np.ndarray
    center: np.ndarray
    size: np.ndarray

    @classmethod
    def empty(cls, keys: Mapping[str, str], clusters: int, classes: int) -> "Answers":
        """Nothing computed yet of the systems named in `keys`, each with what it is."""
        shape = (len(keys), clusters)

        def blank(*more: int) -> np.ndarray:
            return np.full((*shape, *more), np.nan, np.float32)

        return cls(
            system=np.array(list(keys), dtype=str),
            key=np.array(list(keys.values()), dtype=str),
            done=np.zeros(shape, np.bool_),
            probabilities=blank(classes),
            unknown=np.zeros(shape, np.bool_),
            heading=blank(),
            heading_std=blank(),
            bow_probability=blank(),
            center=blank(2),
            size=blank(3),
        )

    def of(self, system: str) -> "Said":
        """The answers of one system.

        Raises:
            ValueError: the system was not asked.
        """
        row = self.system.tolist().index(system)
        return Said(
            self.probabilities[row],
            self.unknown[row],
            self.heading[row],
            self.heading_std[row],
            self.center[row],
            self.size[row],
        )


@dataclass(frozen=True)
class Said:
    """The answers of one system; arrays as in `Answers`, without the first axis."""

    probabilities: np.ndarray
    unknown: np.ndarray
    heading: np.ndarray
    heading_std: np.ndarray
    center: np.ndarray
    size: np.ndarray

    @property
    def answered(self) -> np.ndarray:
        """Whether the cluster was not refused, (M,)."""
        return np.isfinite(self.probabilities[:, 0])

    @property
    def vessel(self) -> np.ndarray:
        """The most probable vessel of the catalogue, REFUSED where the cluster was refused, (M,)."""
        return np.where(self.answered, np.argmax(self.probabilities[:, :-1], axis=1), REFUSED)

    @property
    def decision(self) -> np.ndarray:
        """The most probable vessel, or K where the system calls it unknown; REFUSED where refused, (M,)."""
        outside = self.probabilities.shape[1] - 1
        return np.where(self.answered & self.unknown, outside, self.vessel)


def save(path: Path, truth: Truth, answers: Answers) -> None:
    """Write both to `path`; a reader never sees half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.stem}.{os.getpid()}.npz")
    np.savez_compressed(draft, **_arrays("truth", truth), **_arrays("answers", answers))
    draft.replace(path)


def _arrays(part: str, content: Truth | Answers) -> dict[str, np.ndarray]:
    return {f"{part}_{field.name}": getattr(content, field.name) for field in fields(content)}


def load(path: Path) -> tuple[Truth, Answers]:
    """Read what `save` wrote."""
    with np.load(path, allow_pickle=False) as arrays:
        return (
            Truth(**{f.name: arrays[f"truth_{f.name}"] for f in fields(Truth)}),
            Answers(**{f.name: arrays[f"answers_{f.name}"] for f in fields(Answers)}),
        )


def resume(path: Path, truth: Truth, answers: Answers) -> Answers:
    """`answers`, filled in with those of the file at `path` that systems of the same key gave to the same set."""
    if not path.exists():
        return answers
    found, kept = load(path)
    if not (np.array_equal(found.key, truth.key) and np.array_equal(found.index, truth.index)):
        return answers
    earlier = list(zip(kept.system.tolist(), kept.key.tolist(), strict=True))
    for row, system in enumerate(zip(answers.system.tolist(), answers.key.tolist(), strict=True)):
        if system in earlier:
            for part in fields(Answers)[2:]:
                getattr(answers, part.name)[row] = getattr(kept, part.name)[earlier.index(system)]
    return answers


def digest_of(*files: Path) -> str:
    """SHA-256 over the content of files, the first 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def digest_of_folder(folder: Path) -> str:
    """The digest of all files in a folder and below it."""
    return digest_of(*sorted(path for path in folder.rglob("*") if path.is_file()))
