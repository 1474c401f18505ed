"""Known weaknesses, read off the numbers: where `best` does worst, and where something simpler beats it."""

from collections.abc import Iterable, Iterator

from shipshape_lab.experiments.numbers import DISTANCES, Numbers, aspect_names
from shipshape_lab.experiments.systems import BEST, IMAGE_METHODS, RAW
from shipshape_lab.experiments.targets import TARGETS, as_percent

_DISTANCES = tuple(f"{distance}m" for distance in DISTANCES)
_SLICES = ("overall", "beyond_70m", "bow_on", "stern_on", *_DISTANCES, *aspect_names())


def weaknesses(numbers: Numbers, catalogue: Iterable[str]) -> list[str]:
    """Sentences, most important first; never empty, as something is always worst."""
    return [
        *_unmet(numbers),
        *_worst(numbers, "accuracy.best.{}", "Accuracy", tuple(catalogue)),
        *_worst(numbers, "heading.best.within_5deg.{}", "The share of headings within 5 deg", tuple(catalogue)),
        *_worst(numbers, "bow_stern.best.{}", "Telling bow from stern", tuple(catalogue)),
        *_beaten(numbers),
        *_restoration(numbers),
        *_refusal(numbers),
    ]


def _unmet(numbers: Numbers) -> Iterator[str]:
    for target in TARGETS:
        value, verdict = target.verdict(numbers)
        if verdict != "reached":
            yield f"Target {verdict.replace('*', '')}: {target.text} ({value}, wanted {target.wanted})."


def _worst(numbers: Numbers, key: str, what: str, catalogue: tuple[str, ...]) -> Iterator[str]:
    found = []
    for kind in (_DISTANCES, aspect_names(), catalogue):
        values = {name: numbers[f"P.{key.format(name)}"] for name in kind if f"P.{key.format(name)}" in numbers}
        if values:
            name = min(values, key=lambda name: values[name])
            found.append(f"{spoken(name)} ({as_percent(values[name])})")
    if found:
        yield f"{what} is lowest at {', '.join(found)}."


def _beaten(numbers: Numbers) -> Iterator[str]:
    for rival in (RAW, *IMAGE_METHODS):
        ahead = []
        for part in _SLICES:
            ours, theirs = (numbers.get(f"P.accuracy.{system}.{part}") for system in (BEST, rival))
            if ours is not None and theirs is not None and theirs > ours:
                ahead.append(f"{spoken(part)} ({as_percent(theirs)} against {as_percent(ours)})")
        if ahead:
            yield f"`{rival}` classifies better than `best`: {', '.join(ahead)}."


def _restoration(numbers: Numbers) -> Iterator[str]:
    for rival in ("raw", "mirrored", "mirrored_true_pose", *IMAGE_METHODS):
        behind = []
        for end in ("", *(f".{name}" for name in (*_DISTANCES, *aspect_names(), "bow_on", "stern_on"))):
            ours, theirs = (numbers.get(f"P.cd_l1.{cloud}{end}") for cloud in (BEST, rival))
            if ours is not None and theirs is not None and theirs <= ours:
                behind.append(f"{spoken(end[1:]) if end else 'overall'} ({theirs:.1f} against {ours:.1f})")
        if behind:
            yield f"The `{rival}` cloud has a CD-L1 as low as the restored one or lower: {', '.join(behind)}."


def _refusal(numbers: Numbers) -> Iterator[str]:
    if numbers.get("P.refused"):
        yield f"{numbers['P.refused']} of {numbers['P.clusters']} clusters are refused and count as wrong."
    unknown = numbers.get("P.unknown_share.best", 0.0)
    if unknown > 0:
        yield f"{as_percent(unknown)} of P, all of it in the catalogue, is called unknown."


def spoken(name: str) -> str:
    """A slice as a reader would say it."""
    if name.startswith("aspect_"):
        low, high = name.split("_")[1:]
        return f"aspect {low}-{high} deg"
    if name in _DISTANCES:
        return f"{name[:-1]} m"
    return {"beyond_70m": "beyond 70 m", "bow_on": "bow-on", "stern_on": "stern-on"}.get(
        name, name.replace("_", " ")
    )
