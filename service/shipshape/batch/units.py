"""The values that travel through a run: source -> chunks of clouds -> parts of rows.

A unit is one row: one cluster, or what was refused in its place. Its id is made of the first 16 digits of the
input's sha256, the number of the message and the number of the cluster in it: the same in every run.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float32

SHORT = 16  # digits of a sha256 that tell inputs apart


@dataclass(frozen=True, slots=True)
class Source:
    """One input, by its content."""

    path: Path
    sha256: str
    size: int  # bytes


@dataclass(frozen=True, slots=True)
class Cloud:
    """Points of one message or cluster of an input, level frame, metres; or why there are none."""

    message: int
    cluster: int | None  # None: a whole message, which may hold many or, with an error, none
    points_level: Float32[np.ndarray, "n 3"]
    contact_id: str = ""
    topic: str = ""
    frame_id: str = ""
    stamp_ns: int | None = None  # since 1970 UTC
    error: str = ""


@dataclass(frozen=True, slots=True)
class Chunk:
    """Clouds that follow each other in one input: what a worker is given, and what is lost when one is stopped."""

    sha256: str
    number: int
    clouds: list[Cloud]
    share: float  # of the input that was read when it was full

    @property
    def name(self) -> str:
        """Of its part."""
        return part_name(self.sha256, self.number)

    @property
    def points(self) -> int:
        """Of all its clouds."""
        return sum(len(cloud.points_level) for cloud in self.clouds)


@dataclass(frozen=True, slots=True)
class Part:
    """The rows of one chunk, as the bytes of Parquet files."""

    sha256: str
    name: str
    share: float
    rows: int
    refused: int
    table: bytes = field(repr=False)
    clouds: bytes | None = field(default=None, repr=False)  # restored ones, when they are asked for


@dataclass(frozen=True, slots=True)
class Ending:
    """An input was read to its end, or as far as it went."""

    sha256: str
    chunks: int
    messages: int
    error: str = ""


def part_name(sha256: str, number: int) -> str:
    """Of the part that holds a chunk; sorted by name, the parts of one input are in its order."""
    return f"{sha256[:SHORT]}-{number:06d}"


def part_names(sha256: str, chunks: int) -> Iterator[str]:
    """Of the parts of an input of so many chunks, in order."""
    return (part_name(sha256, number) for number in range(chunks))


def unit_id(sha256: str, message: int, cluster: int | None) -> str:
    """Of one row; without a cluster it stands for a message that was refused whole."""
    whole = f"{sha256[:SHORT]}-{message:08d}"
    return whole if cluster is None else f"{whole}-{cluster:04d}"
