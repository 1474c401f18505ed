"""Section: heading by the paper's search, by rectangles and axes that need no training, and by `best`."""

from collections.abc import Sequence

from shipshape_lab.experiments.markdown import percent, plain, table
from shipshape_lab.experiments.numbers import ASPECT_EDGES, DISTANCES, Numbers, aspect_names

TITLE = "Heading, compared"
COMMAND = "python -m shipshape_lab.experiments.heading_peers --data runs/data --bundle models --out runs/results"
METHODS = {
    "area_projection_told": "area projection, true type's box",
    "paper": "area projection, prior's box (preset `paper`)",
    "min_area": "rectangle of least area",
    "pca": "principal axis (PCA)",
    "l_shape": "L-shape, closeness",
    "best": "`best`",
}
_SETS = {"P": "paper grid P", "H": "hard set H", "far": "far (110 to 180 m)"}
_ASPECTS = tuple(aspect_names())
_DISTANCES = tuple(f"{distance}m" for distance in DISTANCES)


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    tables = [f"**{_SETS[name]}**\n\n{_overall(numbers, name)}" for name in about["sets"]]
    return "\n\n".join(
        [
            _INTRODUCTION,
            *tables,
            "![heading within 5 deg by distance and aspect](figures/heading_peers.png)",
            "P, within 5 deg, %, by aspect and by distance:",
            _by(numbers, _ASPECTS, [f"{low}-{low + 30} deg" for low in ASPECT_EDGES[:-1]]),
            _by(numbers, _DISTANCES, [f"{distance} m" for distance in DISTANCES]),
            _shortfalls(numbers),
        ]
    )


_INTRODUCTION = """\
Error of the heading modulo pi; the sensor's height is not told. *Area projection* is the paper's search for the
box with the best IoU with a reference box (section 3.1.1), once with the box of the true type, once with the box
of the class that the prior names; the paper states 98.03 % "orientation accuracy", class given, without a
tolerance. The *L-shape* fit is that of Zhang et al. (IEEE IV 2017), closeness criterion, its smallest distance
(0.1 m) chosen on the validation set. All searches step by 0.6 deg. *Swapped*: more than 45 deg off, the width
taken for the length. *Flipped*: bow and stern exchanged, for the two that tell them apart; a rectangle or an axis
cannot. Refused clusters count as wrong in every share."""


def _overall(numbers: Numbers, name: str) -> str:
    shares = ("within_5deg", "within_10deg", "swapped_90", "flipped")
    rows = []
    for method, title in METHODS.items():
        key = f"{name}.heading.{method}"
        rows.append(
            (title, plain(numbers, f"{key}.median_deg"), *(percent(numbers, f"{key}.{what}") for what in shares))
        )
    return table(
        ("method", "median, deg", "within 5 deg, %", "within 10 deg, %", "swapped, %", "flipped, %"), rows
    )


def _by(numbers: Numbers, parts: Sequence[str], titles: Sequence[str]) -> str:
    rows = [
        (title, *(percent(numbers, f"P.heading.{method}.within_5deg.{part}") for part in parts))
        for method, title in METHODS.items()
    ]
    return table(("within 5 deg, %", *titles), rows)


def _shortfalls(numbers: Numbers) -> str:
    """Where `best` is not ahead, in words; that it is ahead everywhere if so."""
    behind = []
    for part in (*_DISTANCES, *_ASPECTS):
        shares = {method: numbers.get(f"P.heading.{method}.within_5deg.{part}", 0.0) for method in METHODS}
        first = max(shares, key=lambda method: shares[method])
        if shares[first] > shares["best"]:
            where = part.removeprefix("aspect_").replace("_", "-") + (" deg" if part in _ASPECTS else "")
            behind.append(
                f"{where}: {METHODS[first]} {100 * shares[first]:.2f} %, `best` {100 * shares['best']:.2f} %"
            )
    if behind:
        return f"Where another method has more headings within 5 deg than `best`: {'; '.join(behind)}."
    return "No other method has more headings within 5 deg than `best` at any distance or aspect of P."
