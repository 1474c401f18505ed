"""What the product promises of these numbers, and whether it holds."""

from collections.abc import Callable
from dataclasses import dataclass

from shipshape_lab.experiments.numbers import DISTANCES, Numbers, aspect_names
from shipshape_lab.experiments.systems import BEST, RAW, RIVALS

COMPLETERS = ("pcn", "snowflakenet")
NEVER_BELOW = (RAW, "pointnet")  # in any distance or aspect bin of P
MISSED = "**NOT reached**"
BINS = (*(f"{distance}m" for distance in DISTANCES), *aspect_names())


@dataclass(frozen=True)
class Target:
    """One promise.

    Attributes:
        text: what is promised.
        wanted: how much, as text.
        measure: the value that is compared; a KeyError names a number that was not measured.
        holds: whether a value keeps the promise.
        show: how a value is printed.
    """

    text: str
    wanted: str
    measure: Callable[[Numbers], float]
    holds: Callable[[float], bool]
    show: Callable[[float], str]

    def verdict(self, numbers: Numbers) -> tuple[str, str]:
        """The value as text, and `reached`, MISSED or `not measured`."""
        try:
            value = self.measure(numbers)
        except KeyError:
            return "-", "not measured"
        return self.show(value), "reached" if self.holds(value) else MISSED


def as_percent(share: float) -> str:
    """A share in [0, 1] as a percentage with its sign."""
    return f"{100 * share:.2f} %"


def bins_below(numbers: Numbers) -> list[tuple[str, str]]:
    """(bin of P, rival) wherever a rival that must never lead is more accurate than `best`.

    Raises:
        KeyError: a bin of one of them was not measured.
    """
    key = "P.accuracy.{}.{}".format
    return [
        (part, rival)
        for part in BINS
        for rival in NEVER_BELOW
        if numbers[key(rival, part)] > numbers[key(BEST, part)]
    ]


def _at_least(text: str, key: str, least: float, show: Callable[[float], str] = as_percent) -> Target:
    return Target(
        text, f"at least {show(least)}", lambda numbers: numbers[key], lambda value: value >= least, show
    )


def _at_most(text: str, key: str, most: float, show: Callable[[float], str]) -> Target:
    return Target(text, f"at most {show(most)}", lambda numbers: numbers[key], lambda value: value <= most, show)


def _times(text: str, least: float, ours: str, theirs: tuple[str, ...]) -> Target:
    """Ours must be at least so many times the highest of theirs."""
    return Target(
        text,
        f"at least {least:g} times",
        lambda numbers: numbers[ours] / max(numbers[key] for key in theirs),
        lambda value: value >= least,
        "{:.2f} times".format,
    )


def _share_of(text: str, most: float, ours: str, theirs: tuple[str, ...]) -> Target:
    """Ours must be at most this share of the lowest of theirs."""
    return Target(
        text,
        f"at most {most:g} times",
        lambda numbers: numbers[ours] / min(numbers[key] for key in theirs),
        lambda value: value <= most,
        "{:.2f} times".format,
    )


def _restoration(name: str) -> tuple[Target, Target]:
    def keys(what: str) -> tuple[str, ...]:
        return tuple(f"{name}.{what}.{peer}" for peer in COMPLETERS)

    return (
        _share_of(
            f"restoration on {name}, CD-L1 against the better of PCN and SnowflakeNet",
            1.0,
            f"{name}.cd_l1.best",
            keys("cd_l1"),
        ),
        _times(
            f"restoration on {name}, F-score@1% against the better of both",
            1.0,
            f"{name}.fscore.best",
            keys("fscore"),
        ),
    )


def _milliseconds(value: float) -> str:
    return f"{value:.2f} ms"


def _degrees(value: float) -> str:
    return f"{value:.2f} deg"


TARGETS = (
    _at_least("P, accuracy, all clusters", "P.accuracy.best.overall", 0.998),
    _at_least("P, accuracy beyond 70 m (80 to 110 m)", "P.accuracy.best.beyond_70m", 0.996),
    _at_least("P, accuracy bow-on (aspect up to 15 deg)", "P.accuracy.best.bow_on", 0.995),
    _at_least("P, accuracy stern-on (aspect from 165 deg)", "P.accuracy.best.stern_on", 0.995),
    Target(
        "P, bins of distance or aspect where raw SPD2 or PointNet is ahead",
        "none",
        lambda numbers: float(len({part for part, _ in bins_below(numbers)})),
        lambda value: value == 0,
        "{:.0f} of 15".format,
    ),
    _at_least("the same vessels at 110 to 180 m", "far.accuracy.best", 0.99),
    _share_of(
        "H, error rate against the best peer's", 0.5, "H.error.best", tuple(f"H.error.{peer}" for peer in RIVALS)
    ),
    _times("reach on H against raw SPD2", 1.4, "H.reach_m.best", ("H.reach_m.raw_spd2",)),
    _times(
        "reach on H against the best peer", 1.2, "H.reach_m.best", tuple(f"H.reach_m.{peer}" for peer in RIVALS)
    ),
    _at_most("heading on P modulo pi, median error, class not given", "P.heading.best.median_deg", 1.0, _degrees),
    _at_least("heading on P within 5 deg", "P.heading.best.within_5deg", 0.99),
    _at_least("bow and stern told apart on P", "P.bow_stern.best", 0.995),
    *_restoration("P"),
    *_restoration("H"),
    Target(
        "restoration time, one core, against the faster of PCN and SnowflakeNet",
        "at least 20 times faster",
        lambda numbers: min(numbers[f"P.restore_ms.{peer}"] for peer in COMPLETERS) / numbers["P.restore_ms.best"],
        lambda value: value >= 20.0,
        "{:.1f} times".format,
    ),
    _at_least("R, five real meshes as a catalogue, other scans of them", "R.accuracy.best", 0.98),
    _at_least('U against P, AUROC of the probability of "unknown"', "U.auroc.best", 0.95, "{:.3f}".format),
    _at_most("expected calibration error on P", "P.ece.best", 0.02, "{:.4f}".format),
    _at_most("expected calibration error on H", "H.ece.best", 0.02, "{:.4f}".format),
    _at_most("whole pipeline, 1,000 points, one core, median", "pipeline_ms.best.1000", 2.5, _milliseconds),
)
