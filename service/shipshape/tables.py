"""Recognitions as lines of a table, for people; every line can be written as soon as it is known."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from shipshape.bundle import UNKNOWN
from shipshape.types import Recognition


@dataclass(frozen=True, slots=True)
class Column:
    """Title and width of a column; text goes left, numbers right."""

    title: str
    width: int
    left: bool = False

    def cell(self, text: str) -> str:
        """`text` as wide as the column, or wider rather than cut."""
        return text.ljust(self.width) if self.left else text.rjust(self.width)


ANSWER_COLUMNS = (
    Column("prob.", 6),
    Column("heading", 13),
    Column("bow", 6),
    Column("aspect", 6),
    Column("L x B x H, m", 18),
    Column("measured", 8),
    Column("inferred", 8),
    Column("ms", 6),
    Column("unsure because", 14, left=True),
)


def columns(names: Sequence[str], catalogue: Sequence[str]) -> tuple[Column, ...]:
    """The columns of a table whose lines are called `names`, for the vessels of `catalogue`."""
    vessels = max((len(_doubtful(name)) for name in catalogue), default=0)
    widest = max((len(name) for name in names), default=0)
    return (Column("contact", max(widest, 7), left=True), Column("vessel", vessels, left=True), *ANSWER_COLUMNS)


def title_line(layout: Sequence[Column]) -> str:
    """The titles."""
    return "  ".join(column.cell(column.title) for column in layout).rstrip()


def answer_line(layout: Sequence[Column], name: str, recognition: Recognition) -> str:
    """One recognition, called `name`."""
    cells = (name, *_cells(recognition))
    return "  ".join(column.cell(cell) for column, cell in zip(layout, cells, strict=True)).rstrip()


def refusal_line(layout: Sequence[Column], name: str, error: str) -> str:
    """A contact that got no answer."""
    return f"{layout[0].cell(name)}  refused: {error}"


def _cells(recognition: Recognition) -> tuple[str, ...]:
    size = recognition.box.size
    unknown = recognition.unknown
    probability = recognition.probabilities[UNKNOWN] if unknown else recognition.probability
    return (
        _doubtful(recognition.vessel) if unknown else recognition.vessel,
        f"{probability:.1%}",
        f"{math.degrees(recognition.heading):+.1f} ± {math.degrees(recognition.heading_std):.1f}°",
        f"{recognition.bow_probability:.1%}",
        f"{recognition.aspect_deg:.0f}°",
        f"{size.length:.1f} x {size.beam:.1f} x {size.height:.1f}",
        f"{recognition.measured_points}",
        f"{recognition.inferred_points}",
        f"{sum(recognition.stage_ms.values()):.1f}",
        ", ".join(recognition.reasons),
    )


def _doubtful(vessel: str) -> str:
    return f"{UNKNOWN} (most like {vessel})"
