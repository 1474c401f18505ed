"""Section: how close the restored cloud comes to the whole vessel, on H."""

from shipshape_lab.experiments.markdown import figure
from shipshape_lab.experiments.numbers import BANDS, Numbers, aspect_names
from shipshape_lab.experiments.pages.restoration_p import by_slice, completers, scores

TITLE = "Restoration, on H"
COMMAND = """\
python -m shipshape_lab.experiments.restoration --set H --data runs/data --completers runs/completion \\
  --out runs/results
python -m shipshape_lab.experiments.gallery --set H --data runs/data --bundle models --out docs/figures"""


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    return "\n\n".join(
        [
            INTRODUCTION.format(clusters=numbers["H.restoration.clusters"], every=about["every"]),
            *completers(numbers, "H", about),
            scores(numbers, "H"),
            by_slice(numbers, "H", tuple(f"{low}_{high}m" for low, high in BANDS)),
            by_slice(numbers, "H", tuple(aspect_names())),
            figure("gallery_hard.png", "measured, restored and true clouds of the hard test"),
        ]
    )


INTRODUCTION = """\
{clusters} clusters (every {every}th of H), all ten types, scored as on P. The vessel rolls, pitches and heaves,
and its complete surface with it; a cloud upright over the waterline cannot follow that."""
