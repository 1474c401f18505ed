"""Section: how close the restored cloud comes to the whole vessel, on P."""

from shipshape_lab.experiments.markdown import DISTANCE_SLICES, figure, percent, plain, spoken, table
from shipshape_lab.experiments.numbers import Numbers, aspect_names
from shipshape_lab.experiments.restoration import CLOUDS, REFERENCE_POINTS

TITLE = "Restoration, on P"
COMMAND = """\
python -m shipshape_lab.experiments.restoration --set P --data runs/data --completers runs/completion \\
  --out runs/results
python -m shipshape_lab.experiments.gallery --data runs/data --bundle models --out docs/figures"""


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    return "\n\n".join(
        [
            INTRODUCTION.format(
                clusters=numbers["P.restoration.clusters"], every=about["every"], reference=REFERENCE_POINTS
            ),
            *completers(numbers, "P", about),
            scores(numbers, "P"),
            figure("restoration.png", "CD-L1 and F-score by distance"),
            by_slice(numbers, "P", DISTANCE_SLICES),
            by_slice(numbers, "P", tuple(aspect_names())),
            figure("gallery.png", "measured, restored and true clouds"),
        ]
    )


INTRODUCTION = """\
{clusters} clusters (every {every}th of P) against 16,384 points of the complete outer surface above the water, in
the level frame, so that an error of the pose counts. d is the distance to the nearest neighbour after scaling so
that the **complete** surface's largest extent is 1. CD-L1 = (mean_P d + mean_G d) / 2; CD-L2 = mean_P d^2 +
mean_G d^2; F-score@1% = harmonic mean of the shares with d < 0.01. Clouds are compared as they are, with as many
points as they have. `mirrored` is the raw cluster and its reflection about the centre plane that `best` estimates,
`mirrored_true_pose` about the true one; `pcn` and `snowflakenet` complete the cluster in the pose that `best`
estimates; `surface` is what {reference} other points of the true surface would score, the level that a perfect
cloud of about that size reaches."""


def completers(numbers: Numbers, name: str, about: dict) -> list[str]:
    """How long each completion network was trained, a paragraph each."""
    key = f"{name}.completer.{{}}.{{}}".format
    return [
        f"`{one}` was trained on the {schedule} schedule, {numbers[key(one, 'clusters')]:,} clusters; its last "
        f"round took away {percent(numbers, key(one, 'last_gain'))} % of its CD-L1 on validation."
        for one, schedule in about["completers"].items()
    ]


def scores(numbers: Numbers, name: str) -> str:
    """Scores of every cloud that was made."""
    digits = {"cd_l1": 2, "cd_l2": 3, "fscore": 3, "points": 0}
    rows = [
        (f"`{cloud}`", *(plain(numbers, f"{name}.{what}.{cloud}", places) for what, places in digits.items()))
        for cloud in made(numbers, name)
    ]
    return table(("cloud", "CD-L1 x 1000", "CD-L2 x 1000", "F-score@1%", "points"), rows)


def by_slice(numbers: Numbers, name: str, parts: tuple[str, ...]) -> str:
    """CD-L1 of every cloud, one column a slice."""
    rows = [
        (f"`{cloud}`", *(plain(numbers, f"{name}.cd_l1.{cloud}.{part}", 1) for part in parts))
        for cloud in made(numbers, name)
    ]
    return table(("CD-L1 x 1000", *map(spoken, parts)), rows)


def made(numbers: Numbers, name: str) -> list[str]:
    """The clouds that were scored on a set."""
    return [cloud for cloud in CLOUDS if f"{name}.cd_l1.{cloud}" in numbers]
