"""What every system said of every cluster of a set, beside the truth; kept as plain arrays in .npz.

The file names the bundle and the set that it belongs to, so that a run can go on where it was stopped and a
report never mixes results of two bundles.
"""

import hashlib
import os
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

REFUSED = -1


@dataclass(frozen=True)
class Truth:
    """What is true of M clusters, one entry a cluster, and the key of what they were computed from.

    Attributes:
        key: digests of bundle and set, and the options of the run.
        index: number of each cluster in its set.
        label: index into the bundle's catalogue.
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
    range_m: np.ndarray
    aspect_deg: np.ndarray
    heading: np.ndarray
    center: np.ndarray
    size: np.ndarray
    points: np.ndarray


@dataclass(frozen=True)
class Answers:
    """What S systems said of M clusters; NaN where a system says nothing of the kind.

    Attributes:
        done: whether the cluster was computed yet, (M,).
        vessel: index into the catalogue, REFUSED where the cluster was refused, (S, M).
        probability: of that vessel, (S, M).
        unknown: whether the system would rather call it unknown, (S, M).
        heading: radians, (S, M).
        bow_probability: (S, M).
        center: (S, M, 2), metres, level frame.
        size: (S, M, 3), metres.
        stage_ms: (S, M, stages), in the order of the pipeline; of a machine that may have been busy.
    """

    done: np.ndarray
    vessel: np.ndarray
    probability: np.ndarray
    unknown: np.ndarray
    heading: np.ndarray
    bow_probability: np.ndarray
    center: np.ndarray
    size: np.ndarray
    stage_ms: np.ndarray

    @classmethod
    def empty(cls, systems: int, clusters: int, stages: int) -> "Answers":
        """Nothing computed yet."""
        shape = (systems, clusters)
        numbers = {
            name: np.full((*shape, *more), np.nan, np.float32)
            for name, more in {
                "probability": (),
                "heading": (),
                "bow_probability": (),
                "center": (2,),
                "size": (3,),
                "stage_ms": (stages,),
            }.items()
        }
        return cls(
            done=np.zeros(clusters, np.bool_),
            vessel=np.full(shape, REFUSED, np.int32),
            unknown=np.zeros(shape, np.bool_),
            **numbers,
        )


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
    """The answers in `path` if they belong to the same bundle, set and options; else `answers`."""
    if not path.exists():
        return answers
    found, kept = load(path)
    same = np.array_equal(found.key, truth.key) and np.array_equal(found.index, truth.index)
    return kept if same else answers


def digest_of(*files: Path) -> str:
    """SHA-256 over the content of files, the first 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
