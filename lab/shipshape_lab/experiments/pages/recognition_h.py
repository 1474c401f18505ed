"""Section: the hard test H."""

from shipshape_lab.experiments.hard import POINTS
from shipshape_lab.experiments.markdown import asked, by_slice, figure, percent, plain, spoken, table
from shipshape_lab.experiments.numbers import BANDS, Numbers, aspect_names
from shipshape_lab.experiments.pages.recognition_p import pose

TITLE = "Hard: ten types, sea, occluders, dropout, three sensors"
COMMAND = """\
python -m shipshape_lab.simulator.datasets H --out runs/data
python -m shipshape_lab.experiments.evaluate --set H --data runs/data --peers runs/peers --out runs/results"""
_BANDS = tuple(f"{low}_{high}m" for low, high in BANDS)
_SENSORS = ("pandar64", "os1_64", "hdl64e")
_OCCLUDED = ("occluded", "not_occluded")


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    prefix, head = "H.error.", "wrong decision, %"
    names = (*about["catalogue"], "unknown")
    return "\n\n".join(
        [
            INTRODUCTION.format(clusters=numbers["H.clusters"], refused=numbers["H.refused"]),
            _whole(numbers),
            figure("hard.png", "accuracy on H by range, and the reach of each system"),
            by_slice(numbers, prefix, _BANDS, head),
            by_slice(numbers, prefix, POINTS, head),
            by_slice(numbers, prefix, (*_SENSORS, *_OCCLUDED, "bow_on", "stern_on"), head),
            by_slice(numbers, prefix, aspect_names(), head),
            "What `best` decides, % of the clusters of each class:",
            _confusion(numbers, names),
            figure("confusion.png", "what best decides on H"),
            figure("reliability.png", "how often best is right when it says how sure it is, on P and on H"),
            "Heading and bow, columns as on P:",
            pose(
                numbers,
                "H",
                ("overall", *_BANDS, *_SENSORS, *_OCCLUDED, "in_catalogue", "outside", *aspect_names()),
            ),
        ]
    )


INTRODUCTION = """\
{clusters} clusters ({refused} refused): half of vessels of the catalogue, half of five types outside of it, hulls
that no model saw, 30 to 200 m, half of them in a moderate sea, 30 % behind an occluder, up to 30 % dropout, three
sensor models. Right is the *decision*: the vessel, or "unknown" for what is not in the catalogue. `best` decides
as the service does; every other system takes the most probable of the vessels and "unknown". The paper's method
has no "unknown", so half of H is beyond it; "right vessel" counts the catalogue's clusters alone, as on P.

*Reach*: the range up to which the decision is right for at least 95 % in every window of 30 m, going out metre by
metre; 30 m stands for less than 95 % in the nearest window, 200 m for never less. *Occluded*: something in front
took away at least a tenth of the returns. *Shared*: wrong decisions that `best` makes on the same clusters."""


def _whole(numbers: Numbers) -> str:
    shares = (
        "H.error.{}",
        "H.error_shared.{}",
        "H.accuracy_known.{}",
        "H.called_unknown.{}.in_catalogue",
        "H.called_unknown.{}.outside",
        "H.ece.{}",
    )
    rows = [
        (f"`{s}`", *(percent(numbers, key.format(s)) for key in shares), plain(numbers, f"H.reach_m.{s}", 0))
        for s in asked(numbers, "H.error.")
    ]
    return table(
        (
            "%",
            "wrong decision",
            "shared",
            "right vessel",
            "catalogue called unknown",
            "others called unknown",
            "calibration error",
            "reach, m",
        ),
        rows,
    )


def _confusion(numbers: Numbers, names: tuple[str, ...]) -> str:
    key = "H.confusion.best.{}.{}".format
    rows = [(f"{spoken(true)}", *(percent(numbers, key(true, said)) for said in names)) for true in names]
    return table(("is, down; is called, across", *map(spoken, names)), rows)
