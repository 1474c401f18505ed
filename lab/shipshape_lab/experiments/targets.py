"""What the product promises of these numbers, and whether it holds."""

from collections.abc import Callable
from dataclasses import dataclass

from shipshape_lab.experiments.numbers import Numbers

CLEARLY = 0.8  # "clearly better than mirrored": at most this share of its Chamfer distance


@dataclass(frozen=True)
class Target:
    """One promise.

    Attributes:
        text: what is promised.
        wanted: how much, as text.
        keys: the numbers that it needs.
        measure: the value that is compared, from those numbers.
        holds: whether a value keeps the promise.
        show: how a value is printed.
    """

    text: str
    wanted: str
    keys: tuple[str, ...]
    measure: Callable[..., float]
    holds: Callable[[float], bool]
    show: Callable[[float], str]

    def verdict(self, numbers: Numbers) -> tuple[str, str]:
        """The value as text, and `reached`, `NOT reached` or `not measured`."""
        if any(key not in numbers for key in self.keys):
            return "-", "not measured"
        value = self.measure(*(numbers[key] for key in self.keys))
        return self.show(value), "reached" if self.holds(value) else "**NOT reached**"


def as_percent(share: float) -> str:
    """A share in [0, 1] as a percentage with its sign."""
    return f"{100 * share:.2f} %"


def _share(text: str, key: str, least: float) -> Target:
    return Target(text, f"at least {100 * least:g} %", (key,), float, lambda value: value >= least, as_percent)


def _ratio(ours: float, theirs: float) -> float:
    return ours / theirs


TARGETS = (
    _share("heading modulo pi within 5 deg, class not given", "P.heading.best.within_5deg", 0.95),
    _share("bow and stern told apart", "P.bow_stern.best", 0.98),
    _share("accuracy, all clusters", "P.accuracy.best.overall", 0.98),
    _share("accuracy beyond 70 m (80 to 110 m)", "P.accuracy.best.beyond_70m", 0.97),
    _share("accuracy bow-on (aspect up to 15 deg)", "P.accuracy.best.bow_on", 0.97),
    _share("accuracy stern-on (aspect from 165 deg)", "P.accuracy.best.stern_on", 0.97),
    Target(
        "restored clearly better than mirrored: ratio of CD-L1",
        f"at most {CLEARLY:g}",
        ("P.cd_l1.best", "P.cd_l1.mirrored"),
        _ratio,
        lambda value: value <= CLEARLY,
        "{:.2f}".format,
    ),
    Target(
        "restored better than mirrored: ratio of F-score@1%",
        "above 1",
        ("P.fscore.best", "P.fscore.mirrored"),
        _ratio,
        lambda value: value > 1.0,
        "{:.2f}".format,
    ),
    Target(
        "1,000 points through the whole pipeline, one core, median",
        "at most 5 ms",
        ("pipeline_ms.best.1000",),
        float,
        lambda value: value <= 5.0,
        "{:.2f} ms".format,
    ),
)
