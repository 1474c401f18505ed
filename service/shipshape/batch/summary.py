"""All rows of a run, counted: what the report, the table on the terminal and summary.json tell."""

from collections import Counter, defaultdict

import numpy as np
import pyarrow as pa

from shipshape.bundle import UNKNOWN

PROBABILITY_EDGES = np.linspace(0.0, 1.0, 21)
MS_EDGES = np.geomspace(0.1, 10_000.0, 251)  # 4.7 % apart
REFUSALS = 50  # kinds that are told apart


class Tally:
    """Counts that grow with each part; their size does not."""

    def __init__(self) -> None:
        self.contacts = 0
        self.vessels: Counter[str] = Counter()
        self.reasons: Counter[str] = Counter()
        self.refusals: Counter[str] = Counter()
        self.probability = np.zeros(len(PROBABILITY_EDGES) - 1, np.int64)
        self.ms = np.zeros(len(MS_EDGES) - 1, np.int64)  # of all stages together
        self.stage_ms: defaultdict[str, float] = defaultdict(float)  # milliseconds of all contacts

    @property
    def refused(self) -> int:
        """Contacts without an answer."""
        return sum(self.refusals.values())

    @property
    def answered(self) -> int:
        """Contacts with an answer."""
        return self.contacts - self.refused

    def add(self, table: pa.Table) -> None:
        """Count the rows of a part."""
        self.contacts += len(table)
        for error in table["error"].drop_null().to_pylist():
            self.refusals[self._kind(error)] += 1
        answered = table.filter(table["error"].is_null())
        for vessel, unknown in zip(answered["vessel"].to_pylist(), answered["unknown"].to_pylist(), strict=True):
            self.vessels[UNKNOWN if unknown else vessel] += 1
        for reasons in answered["reasons"].to_pylist():
            self.reasons.update(reasons)
        self.probability += np.histogram(answered["probability"].to_numpy(), PROBABILITY_EDGES)[0]
        totals = [self._add_stages(stages) for stages in answered["stage_ms"].to_pylist()]
        self.ms += np.histogram(np.clip(totals, MS_EDGES[0], MS_EDGES[-1]), MS_EDGES)[0]

    def percentile_ms(self, percent: float) -> float | None:
        """Milliseconds that so many percent of the answers took at most, to 5 %; None where there are none."""
        if not self.ms.sum():
            return None
        at = int(np.searchsorted(np.cumsum(self.ms), self.ms.sum() * percent / 100))
        return float(MS_EDGES[1:][min(at, len(self.ms) - 1)])

    def _add_stages(self, stages: list[tuple[str, float]]) -> float:
        for stage, milliseconds in stages:
            self.stage_ms[stage] += milliseconds
        return sum(milliseconds for _, milliseconds in stages)

    def _kind(self, error: str) -> str:
        """What was expected, without what came: one kind for any number of sentences."""
        kind = error.partition(", got")[0]
        return kind if kind in self.refusals or len(self.refusals) < REFUSALS else "other reasons"
