"""Section: the paper's Experiment 2, classifiers trained on complete and on restored clouds side by side."""

from collections.abc import Sequence

from shipshape_lab.experiments.markdown import PUBLISHED, percent, table
from shipshape_lab.experiments.numbers import ASPECT_EDGES, DISTANCES, Numbers, aspect_names
from shipshape_lab.experiments.systems import IMAGE_METHODS, RAW

TITLE = "Experiment 2, both ways"
COMMAND = "\n".join(
    [
        "for model in full_top full_side z_top z_side raw; do",
        "  python -m shipshape_lab.training.train_complete --model $model \\",
        "    --data runs/data --out runs/experiment_2",
        "done",
        "python -m shipshape_lab.experiments.experiment_2 --data runs/data --bundle models --out runs/results",
    ]
)
_SYSTEMS = (RAW, *IMAGE_METHODS)
_PARTS = {"overall": "all", "beyond_70m": "beyond 70 m", "bow_on": "bow-on", "stern_on": "stern-on"}
_TRAINED = {"complete": "complete (3.3.2)", "restored": "restored (4.1.2)"}


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    distances = {f"{distance}m": f"{distance} m" for distance in DISTANCES}
    aspects = dict(zip(aspect_names(), (f"{low}-{low + 30} deg" for low in ASPECT_EDGES), strict=False))
    return "\n\n".join(
        [
            _INTRODUCTION,
            _beside_paper(numbers),
            "![accuracy by distance and aspect](figures/experiment_2.png)",
            _by(numbers, distances),
            _by(numbers, aspects),
            _conclusion(numbers),
        ]
    )


_INTRODUCTION = """\
Right vessel on P, %, preset `paper`. The paper trains its classifiers on complete clouds in section 3.3.2 and on
restored ones in section 4.1.2; both are done here, and both read the same restored test clouds. *Complete*: each
training hull of the catalogue once, in its true pose and its class's reference box, encoded by the image method
and lifted, nothing inpainted, up to 64 densest points a hull. *Restored*: what the service restores of the
training set's clusters, the networks of the bundle. The row `raw_spd2` is the classifier of raw clusters: trained
on raw clusters under *restored*, and, as a control that the paper does not have, on complete surfaces under
*complete*. *(Italics)*: what the paper's text gives, on its own hulls and simulator; it does not say which way of
training its figures are of."""


def _beside_paper(numbers: Numbers) -> str:
    rows = []
    for system in _SYSTEMS:
        for trained, title in _TRAINED.items():
            key = f"P.accuracy_{trained}.{system}"
            rows.append((f"`{system}`", title, *(percent(numbers, f"{key}.{part}") for part in _PARTS)))
        published = (PUBLISHED.get((system, part), "-") for part in _PARTS)
        rows.append((f"`{system}`", "*paper*", *(f"*({figure})*" for figure in published)))
    return table(("classifier", "trained on", *_PARTS.values()), rows)


def _by(numbers: Numbers, parts: dict[str, str]) -> str:
    rows = [
        (f"`{system}`, {title}", *(percent(numbers, f"P.accuracy_{trained}.{system}.{part}") for part in parts))
        for system in _SYSTEMS
        for trained, title in _TRAINED.items()
    ]
    return table(("right vessel, %", *parts.values()), rows)


def _conclusion(numbers: Numbers) -> str:
    """What the two ways differ by, and whether restoring pays, in words."""
    gains = [
        100 * (numbers[f"P.accuracy_restored.{m}.overall"] - numbers[f"P.accuracy_complete.{m}.overall"])
        for m in IMAGE_METHODS
    ]
    better = _ahead(numbers, "overall"), _ahead(numbers, "beyond_70m")
    return (
        f"Training on restored clouds changes the accuracy of the four image methods by {min(gains):+.1f} to "
        f"{max(gains):+.1f} points against training on complete ones. Trained on restored clouds, "
        f"{_listed(better[0])} beat the raw cluster's classifier over all, {_listed(better[1])} beyond 70 m."
    )


def _ahead(numbers: Numbers, part: str) -> list[str]:
    raw = numbers[f"P.accuracy_restored.{RAW}.{part}"]
    return [f"`{m}`" for m in IMAGE_METHODS if numbers[f"P.accuracy_restored.{m}.{part}"] > raw]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if names else "none of the four"
