"""A Prometheus histogram that is told much and seldom asked: what it is told is sorted into buckets in bulk.

One observation of the client library's own histogram takes microseconds, and every contact brings ten of them.
"""

import threading
from bisect import bisect_left
from collections import deque
from collections.abc import Iterable, Sequence

from prometheus_client import CollectorRegistry
from prometheus_client.core import HistogramMetricFamily
from prometheus_client.registry import Collector
from prometheus_client.utils import floatToGoString

MOST = 512  # observations that wait to be sorted


class BulkHistogram(Collector):
    """A histogram with one label.

    Args:
        name: Of the metric.
        documentation: Of the metric.
        label: Its name.
        buckets: Their upper bounds, ascending, without the infinite one.
        registry: Asks for it.
    """

    def __init__(
        self, name: str, documentation: str, label: str, *, buckets: Sequence[float], registry: CollectorRegistry
    ) -> None:
        self._about = (name, documentation)
        self._label = label
        self._buckets = buckets
        self._waiting: deque[tuple[str, float]] = deque()
        self._lock = threading.Lock()  # guards what follows
        self._counts: dict[str, list[int]] = {}
        self._sums: dict[str, float] = {}
        registry.register(self)

    def observe(self, label: str, value: float) -> None:
        """One more value. Safe to use from any thread."""
        self._waiting.append((label, value))
        if len(self._waiting) > MOST:
            with self._lock:
                self._sort()

    def collect(self) -> Iterable[HistogramMetricFamily]:
        """What Prometheus reads."""
        family = HistogramMetricFamily(*self._about, labels=[self._label])
        bounds = [*map(floatToGoString, self._buckets), "+Inf"]
        with self._lock:
            self._sort()
            for label, counts in self._counts.items():
                total, cumulative = 0, []
                for bound, count in zip(bounds, counts, strict=True):
                    total += count
                    cumulative.append((bound, total))
                family.add_metric([label], cumulative, self._sums[label])
        yield family

    def _sort(self) -> None:
        while self._waiting:
            label, value = self._waiting.popleft()
            if label not in self._counts:
                self._counts[label] = [0] * (len(self._buckets) + 1)
                self._sums[label] = 0.0
            self._counts[label][bisect_left(self._buckets, value)] += 1
            self._sums[label] += value
