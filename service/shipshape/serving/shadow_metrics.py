"""Metrics of a shadow bundle: how its answers differ from those of the running one."""

from enum import StrEnum

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

from shipshape.serving.comparison import Difference

DEGREES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 45.0, 90.0)
SHARES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
METRES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 50.0)


class Verdict(StrEnum):
    """What became of a contact that was to be compared."""

    SAME = "same"  # both say the same class
    DIFFERS = "differs"
    FAILED = "failed"  # the shadow has no answer to it
    DROPPED = "dropped"  # there was no room


class ShadowMetrics:
    """What Prometheus is told; the counters go on when another bundle becomes the shadow.

    Args:
        registry: Holds them.
    """

    def __init__(self, registry: CollectorRegistry) -> None:
        self._compared = Counter(
            "shipshape_shadow_compared",
            "Contacts that were to be compared with the shadow bundle, by whether the class is the same.",
            ["verdict"],
            registry=registry,
        )
        self._heading = Histogram(
            "shipshape_shadow_heading_degrees",
            "Between the headings of the running bundle and the shadow, modulo 180; bow: whether they point "
            "the same way.",
            ["bow"],
            buckets=DEGREES,
            registry=registry,
        )
        self._probability = Histogram(
            "shipshape_shadow_probability",
            "Share of the probability that the shadow gives to other classes (total variation).",
            buckets=SHARES,
            registry=registry,
        )
        self._box = Histogram(
            "shipshape_shadow_box_metres",
            "Between the boxes, of length, beam and height the one that differs most.",
            buckets=METRES,
            registry=registry,
        )
        self._bundle = Gauge(
            "shipshape_shadow_info", "1 for the shadow bundle.", ["name", "digest"], registry=registry
        )

    def set_bundle(self, name: str, digest: str) -> None:
        """Which bundle is the shadow."""
        self._bundle.clear()
        self._bundle.labels(name, digest).set(1)

    def no_bundle(self) -> None:
        """None is."""
        self._bundle.clear()

    def count(self, verdict: Verdict) -> None:
        """A contact came to this."""
        self._compared.labels(verdict.value).inc()

    def observe(self, found: Difference) -> None:
        """Both answers are there."""
        self._heading.labels("opposite" if found.opposite else "same").observe(found.axis_deg)
        self._probability.observe(found.probability)
        self._box.observe(found.box_m)
