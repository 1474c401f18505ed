"""What does not work, read off the numbers: where `best` does worst, and where something simpler beats it."""

from collections.abc import Iterable, Iterator

from shipshape_lab.experiments.hard import POINTS
from shipshape_lab.experiments.markdown import DISTANCE_SLICES, asked, spoken
from shipshape_lab.experiments.numbers import BANDS, Numbers, aspect_names
from shipshape_lab.experiments.rejection import GROUPS
from shipshape_lab.experiments.systems import BEST, RIVALS
from shipshape_lab.experiments.targets import COMPLETERS, MISSED, TARGETS, as_percent

_ASPECTS = ("bow_on", "stern_on", *aspect_names())
_BANDS = tuple(f"{low}_{high}m" for low, high in BANDS)
_SLICES = {
    "P": ("overall", *DISTANCE_SLICES, *_ASPECTS),
    "far": ("", *_BANDS, *_ASPECTS),
    "H": ("", *_BANDS, "occluded", "not_occluded", *_ASPECTS),
}
_STILL_FALLING = 0.02  # share of its error that a network's last round took away
_SURE = 0.02  # said more often than it is right by this much: worth a sentence


def weaknesses(numbers: Numbers, catalogue: Iterable[str]) -> list[str]:
    """Sentences, most important first; empty only where nothing was measured."""
    return [
        *_unmet(numbers),
        *_hard(numbers),
        *_worst(numbers, tuple(catalogue)),
        *_beaten(numbers),
        *_restoration(numbers),
        *_completers(numbers),
        *_unknown(numbers, tuple(catalogue)),
        *_spread(numbers),
        *_refusal(numbers),
    ]


def _unmet(numbers: Numbers) -> Iterator[str]:
    for target in TARGETS:
        value, verdict = target.verdict(numbers)
        if verdict == MISSED:
            yield f"Target not reached: {target.text} ({value}, wanted {target.wanted})."


def _hard(numbers: Numbers) -> Iterator[str]:
    """Why the errors on H could not be halved, what was tried and what it would take."""
    rivals = {rival: numbers[f"H.error.{rival}"] for rival in RIVALS if f"H.error.{rival}" in numbers}
    if not rivals or f"H.error.best.{POINTS[0]}" not in numbers:
        return
    rival = min(rivals, key=rivals.__getitem__)
    both, half = as_percent(numbers[f"H.error_shared.{rival}"]), as_percent(rivals[rival] / 2)
    few = ", ".join(f"{spoken(part)} {as_percent(numbers[f'H.error.best.{part}'])}" for part in POINTS)
    yield (
        f"H: half of the errors of `{rival}` would be {half}; on {both} of the clusters both it and `best` are "
        f"wrong, whatever chooses between them. The errors of `best` are those of small clusters: {few}. Tried on "
        "validation, where no command repeats it: weights of the evidence that depend on range and number of "
        "points (no gain). It would take more returns of the vessel, from several scans of one track, or far more "
        "training clusters of few points."
    )


def _worst(numbers: Numbers, catalogue: tuple[str, ...]) -> Iterator[str]:
    kinds = {
        "P": (DISTANCE_SLICES, aspect_names(), catalogue),
        "H": (_BANDS, aspect_names(), ("occluded",), catalogue),
    }
    for what, key in (
        ("P: accuracy", "P.accuracy.best.{}"),
        ("H: accuracy", "H.error.best.{}"),
        ("P: the share of headings within 5 deg", "P.heading.best.within_5deg.{}"),
        ("H: the share of headings within 5 deg", "H.heading.best.within_5deg.{}"),
        ("H: telling bow from stern", "H.bow_stern.best.{}"),
    ):
        found = [text for parts in kinds[key[0]] for text in _lowest(numbers, key, parts)]
        if found:
            yield f"{what} is lowest at {', '.join(found)}."


def _lowest(numbers: Numbers, key: str, parts: Iterable[str]) -> Iterator[str]:
    values = {part: numbers[key.format(part)] for part in parts if key.format(part) in numbers}
    if ".error." in key:
        values = {part: 1.0 - value for part, value in values.items()}
    if values and min(values.values()) < 1.0:
        part = min(values, key=lambda part: values[part])
        yield f"{spoken(part)} ({as_percent(values[part])})"


def _beaten(numbers: Numbers) -> Iterator[str]:
    for name, parts in _SLICES.items():
        prefix = "H.error." if name == "H" else f"{name}.accuracy."
        for rival in asked(numbers, prefix):
            ahead = []
            for part in parts:
                keys = [f"{prefix}{system}{f'.{part}' if part else ''}" for system in (BEST, rival)]
                if rival == BEST or any(key not in numbers for key in keys):
                    continue
                ours, theirs = (1.0 - numbers[key] if name == "H" else numbers[key] for key in keys)
                if theirs > ours:
                    ahead.append(f"{spoken(part or 'overall')} ({as_percent(theirs)} against {as_percent(ours)})")
            if ahead:
                yield f"{name}: `{rival}` names vessels better than `best`: {', '.join(ahead)}."


def _restoration(numbers: Numbers) -> Iterator[str]:
    for name in ("P", "H"):
        ours = numbers.get(f"{name}.cd_l1.best")
        rivals = {
            key.split(".")[2]: value
            for key, value in numbers.items()
            if key.startswith(f"{name}.cd_l1.") and key.count(".") == 2
        }
        ahead = [
            f"`{rival}` ({value:.1f} against {ours:.1f})"
            for rival, value in rivals.items()
            if ours is not None and rival not in (BEST, "surface") and value <= ours
        ]
        if ahead:
            yield f"{name}: clouds whose CD-L1 is as low as the restored one's or lower: {', '.join(ahead)}."


def _completers(numbers: Numbers) -> Iterator[str]:
    trained = {
        peer: numbers[f"P.completer.{peer}.clusters"]
        for peer in COMPLETERS
        if numbers.get(f"P.completer.{peer}.last_gain", 0.0) > _STILL_FALLING
    }
    if trained:
        said = " and ".join(f"`{peer}` on {clusters:,.0f}" for peer, clusters in trained.items())
        yield (
            f"Restoration: the completion networks were trained shorter than they could be, {said} clusters; "
            "their error was still falling. At the published size and schedule, which wants a GPU "
            "(`shipshape-lab completers --schedule full`), they may be ahead; in milliseconds they stay behind."
        )


def _unknown(numbers: Numbers, catalogue: tuple[str, ...]) -> Iterator[str]:
    prefix = "U.called_unknown.best."
    taken = {key.removeprefix(prefix): 1.0 - value for key, value in numbers.items() if key.startswith(prefix)}
    worst = sorted((item for item in taken.items() if item[0] not in GROUPS), key=lambda item: -item[1])[:3]
    if worst and worst[0][1] > 0:
        said = ", ".join(f"{spoken(kind)} ({as_percent(share)})" for kind, share in worst)
        yield f"U: most often taken for a vessel of the catalogue: {said}."
    for name in ("P", "far"):
        share = numbers.get(f"{name}.unknown_share.best", 0.0)
        if share > 0:
            yield f"{name}: {as_percent(share)}, all of it in the catalogue, is called unknown."
    for vessel in catalogue:
        share = numbers.get(f"H.confusion.best.{vessel}.unknown", 0.0)
        if share > _SURE:
            yield f"H: {as_percent(share)} of the {spoken(vessel)}s are called unknown."


def _spread(numbers: Numbers) -> Iterator[str]:
    for name in ("P", "H"):
        key = f"{name}.heading.best.within_1std"
        if key in numbers and not 0.6 <= numbers[key] <= 0.8:
            inside = as_percent(numbers[key])
            yield f"{name}: {inside} of the headings lie within the said standard deviation; it should be 68 %."


def _refusal(numbers: Numbers) -> Iterator[str]:
    for name in ("P", "far", "H", "U"):
        refused, clusters = (numbers.get(f"{name}.{what}", 0) for what in ("refused", "clusters"))
        if refused:
            yield f"{name}: {refused} of {clusters} clusters are refused and count as wrong."
