"""Parts that the sections of docs/results.md share: tables, cells, and what the paper published."""

from collections.abc import Iterable, Sequence
from pathlib import PurePosixPath

from shipshape_lab.experiments.numbers import DISTANCES, Numbers
from shipshape_lab.experiments.systems import SYSTEMS

# Sensors 2026, 26(5), 1637, as far as its text gives figures; other hulls and another simulator than ours.
PUBLISHED = {
    ("raw_spd2", "overall"): "97.15",
    ("raw_spd2", "beyond_70m"): "95.17",
    ("raw_spd2", "bow_on"): "95.26",
    ("raw_spd2", "stern_on"): "91.51",
    ("full_side", "overall"): "97.06",
    ("full_side", "beyond_70m"): "96.76",
    ("full_side", "bow_on"): "96.89",
    ("z_side", "overall"): "96.20",
    ("z_side", "stern_on"): "98.41",
    ("full_top", "overall"): "95.23",
    ("z_top", "overall"): "90.18",
}


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; the first column to the left, the others to the right."""
    rule = [":---", *["---:"] * (len(header) - 1)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (header, rule, *rows))


def percent(numbers: Numbers, key: str) -> str:
    """A share as a percentage, - where it was not measured."""
    return f"{100 * numbers[key]:.2f}" if key in numbers else "-"


def plain(numbers: Numbers, key: str, digits: int = 2) -> str:
    """A number, - where it was not measured."""
    return f"{numbers[key]:.{digits}f}" if key in numbers else "-"


def figure(name: str, alt: str) -> str:
    """A link to a figure in docs/figures."""
    return f"![{alt}]({PurePosixPath('figures') / name})"


def asked(numbers: Numbers, prefix: str) -> list[str]:
    """The systems that have a number under `prefix`, in the order of the tables."""
    return [
        name
        for name in SYSTEMS
        if any(key == prefix + name or key.startswith(f"{prefix}{name}.") for key in numbers)
    ]


def by_slice(numbers: Numbers, prefix: str, parts: Sequence[str], head: str) -> str:
    """Shares of every system that was asked, %, one column a slice."""
    rows = [
        (f"`{name}`", *(percent(numbers, f"{prefix}{name}.{part}") for part in parts))
        for name in asked(numbers, prefix)
    ]
    return table((head, *map(spoken, parts)), rows)


def spoken(name: str) -> str:
    """A slice as a reader would say it."""
    words = name.split("_")
    if words[0] == "aspect":
        return f"aspect {words[1]}-{words[2]} deg"
    if "points" in words:
        return f"{words[0]}-{words[1]} points" if words[-1] == "points" else f"{words[0]} points or more"
    if name.endswith("m") and name[:-1].replace("_", "").isdigit():
        return f"{name[:-1].replace('_', '-')} m"
    ends = {"beyond_70m": "beyond 70 m", "bow_on": "bow-on", "stern_on": "stern-on", "overall": "all"}
    return ends.get(name, name.replace("_", " "))


DISTANCE_SLICES = tuple(f"{distance}m" for distance in DISTANCES)
