"""Section: what the reason codes and the stated spread of the heading are worth."""

from shipshape.types import Reason
from shipshape_lab.experiments.markdown import percent, table
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.reasons import OFF_ENDS_DEG, RANGES_M

TITLE = "Reason codes and the spread of the heading"
COMMAND = "python -m shipshape_lab.experiments.reasons --data runs/data --bundle models --out runs/results"
_WARNS_OF = {
    Reason.FEW_POINTS: "wrong name",
    Reason.END_ON: "length off by more than 10 %",
    Reason.OCCLUDED: "a fifth of the returns hidden",
    Reason.BOW_UNCERTAIN: "wrong bow",
    Reason.OUT_OF_CATALOGUE: "outside the catalogue",
}
_SETS = {"validation": "validation (thresholds fitted here)", "H": "hard set H (only reported)"}


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    parts = [_INTRODUCTION]
    for name in about["sets"]:
        parts += [f"**{_SETS[name]}**", _codes(numbers, name), _spread(numbers, name)]
    return "\n\n".join([*parts, _SHORTFALLS])


_INTRODUCTION = """\
Each answer of `best` carries codes that say what to doubt. *Precision*: of the contacts with the code, the share
to which happened what it warns of; *recall*: of those to which it happened, the share that had the code. The
thresholds of all codes are fitted on validation. Below each table: the share of headings (modulo pi) within one
and two of the standard deviations that the answer states; a normal distribution has 68.3 and 95.4 %."""

_SHORTFALLS = """\
A warning is no verdict: most contacts with few points are named right all the same. What hides the end of a hull
leaves a cluster that looks like a shorter vessel, and nothing in the answer can tell: `occluded` misses it."""


def _codes(numbers: Numbers, name: str) -> str:
    rows = [
        (
            f"`{reason}`",
            warns_of,
            *(
                percent(numbers, f"{name}.reason_{what}.best.{reason}")
                for what in ("given", "precision", "recall")
            ),
        )
        for reason, warns_of in _WARNS_OF.items()
    ]
    return table(("code", "warns of", "given, %", "precision, %", "recall, %"), rows)


def _spread(numbers: Numbers, name: str) -> str:
    titles = {"": "all"}
    titles |= {f".{low}_{high}m": f"{low}-{high} m" for low, high in RANGES_M}
    titles |= {f".off_ends_{low}_{high}deg": f"{low}-{high} deg off the ends" for low, high in OFF_ENDS_DEG}
    rows = [
        (title, *(percent(numbers, f"{name}.heading_std.best.within_{k}std{part}") for k in (1, 2)))
        for part, title in titles.items()
    ]
    return table(("heading", "within 1 std, %", "within 2 std, %"), rows)
