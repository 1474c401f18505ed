"""Section: what the cheaper answers are worth that the service gives when time is short."""

from shipshape.types import Rung
from shipshape_lab.experiments.markdown import percent, plain, table
from shipshape_lab.experiments.numbers import Numbers

TITLE = "The ladder of cheaper answers"
COMMAND = "python -m shipshape_lab.experiments.ladder --data runs/data --bundle models --out runs/results"
_SHARES = ("accuracy", "ece", "heading_within_5deg", "bow_stern", "within_1std")


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    return "\n\n".join([_INTRODUCTION, *(_set(numbers, name) for name in about["sets"]), _SHORTFALLS])


_INTRODUCTION = """\
When the time left is too short for the full answer of `best`, the service takes a cheaper one and says so:
`without_restoration` stops after the pose and names the vessel from the looks alone, `heading_and_box` takes one
aligned look less besides. Each contact was computed on every rung. On P the most probable vessel counts, elsewhere
the decision, which may be "unknown"; *within 1 std* is the share of headings within the spread that the answer
states, 68.3 % for a normal distribution; *ms* is processor time, the median."""

_SHORTFALLS = """\
No rung below `full` was calibrated for itself: the two witnesses that are left share the weight that validation
gave all four, and the spread of the heading is scaled as for two looks. The columns *calibration error* and
*within 1 std* say what that costs."""


def _set(numbers: Numbers, name: str) -> str:
    rows = [
        (
            f"`{rung}`",
            *(percent(numbers, f"{name}.ladder.{share}.{rung}") for share in _SHARES),
            plain(numbers, f"{name}.ladder.heading_median_deg.{rung}"),
            plain(numbers, f"{name}.ladder.ms.{rung}"),
        )
        for rung in Rung
    ]
    title = f"{name}, {numbers[f'{name}.ladder.clusters']:.0f} clusters"
    header = ("right, %", "calibration error, %", "heading within 5 deg, %", "bow, %", "within 1 std, %")
    return table((title, *header, "heading, median deg", "ms"), rows)
