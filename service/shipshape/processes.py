"""What the service and its worker processes take together; the usual `process_...` metrics tell of the first."""

from collections.abc import Iterator
from contextlib import suppress

import psutil
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector


class Processes(Collector):
    """Looks at this process and all below it whenever somebody scrapes."""

    def __init__(self) -> None:
        self._spent: dict[psutil.Process, float] = {}  # seconds of each, also of those that have ended since

    def collect(self) -> Iterator[Metric]:
        """Memory and processor time of all."""
        memory = 0
        top = psutil.Process()
        for process in [top, *top.children(recursive=True)]:
            with suppress(psutil.Error):  # it has just ended
                memory += _memory(process)
                used = process.cpu_times()
                self._spent[process] = used.user + used.system
        yield GaugeMetricFamily(
            "shipshape_memory_bytes",
            "Memory of all processes of the service; what several of them share counts once.",
            memory,
        )
        yield CounterMetricFamily(
            "shipshape_cpu_seconds",
            "Processor time of all processes of the service.",
            sum([*self._spent.values()]),  # a copy: two may scrape at the same time
        )


def _memory(process: psutil.Process) -> int:
    found = process.memory_full_info()
    return int(getattr(found, "pss", found.rss))  # Linux alone tells whose the shared pages are
