"""Calls of one network that meet become one run: an accelerator takes many rows in little more time than one.

A call that finds the network idle runs at once. Calls that come meanwhile wait for the run under way and nothing
else: its thread then hands the network to the first in line, which takes along those of its shape, as many rows as
the largest bucket holds. So there is no timer, nobody waits while the network is idle, and batches grow with the
load by themselves. Rows are padded to a bucket, so that the device sees few shapes.
"""

import logging
import math
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence

import numpy as np

BUCKETS = (1, 2, 4, 8, 16, 32)  # rows of a run
PAYS_BELOW = 0.7  # of a row's seconds in the bucket before: about 1 on a busy core, 0.5 where the device had room
REPEATS = 5  # of a run whose seconds are measured; the least counts

Arrays = Mapping[str, np.ndarray]
Run = Callable[[Arrays], list[np.ndarray]]
_logger = logging.getLogger(__name__)


class MicroBatches:
    """One network's calls, in runs of one at a time; safe to call from any thread.

    The first call also runs every bucket that will be used, so that no later one is the first of its shape.

    Args:
        run: The network: arrays with a row a cluster or image -> the same; each row's answer is its own alone.
        label: How log messages call it.
        buckets: Rows that a run may have, from 1 upwards.
        measured: Whether buckets are used only as far as they are measured to pay, by PAYS_BELOW; else all are.
        clock: Monotonic seconds.
    """

    def __init__(
        self,
        run: Run,
        *,
        label: str = "the model",
        buckets: Sequence[int] = BUCKETS,
        measured: bool = False,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._run = run
        self._label = label
        self._buckets = tuple(buckets)
        self._measured = measured
        self._clock = clock
        self._lock = threading.Lock()  # guards everything below
        self._line: deque[_Call] = deque()
        self._busy = False
        self._tried = False
        self.runs = 0  # so far, of one call or several
        self.rows = 0  # of all runs, without padding

    @property
    def largest(self) -> int:
        """Rows of the largest bucket in use; 1 when calls do not share runs."""
        return self._buckets[-1]

    def run(self, inputs: Arrays) -> list[np.ndarray]:
        """The outputs for these inputs, as if the call had been alone; the caller may write into them.

        Raises:
            Exception: What the network raises for these inputs; those of other calls change nothing.
        """
        # Inputs without rows go there too: the network itself says what is wrong with them.
        if self.largest == 1 or not (rows := _rows_of(inputs)):
            return self._run(inputs)
        call = _Call(inputs, rows)
        try:
            if not self._begins(call):
                call.woken.get()
            if call.leads:
                self._lead(call)
        finally:  # also when a signal ends the wait: whatever this call holds, others need it
            if call.outputs is None or call.leads:
                self._leave(call)
        return self._run(inputs) if call.outputs is None else call.outputs

    def _begins(self, call: "_Call") -> bool:
        """Take the network if it is idle, else stand in line."""
        with self._lock:
            if self._busy:
                self._line.append(call)
            else:
                call.leads = self._busy = True
            return call.leads

    def _leave(self, call: "_Call") -> None:
        """Stand in line no longer, and hand the network, if this call has it, to the first who does."""
        with self._lock:
            if call in self._line:
                self._line.remove(call)
            if not call.leads:
                return
            call.leads, self._busy = False, bool(self._line)
            if self._line:
                heir = self._line.popleft()
                heir.leads = True
                heir.woken.put(None)

    def _lead(self, first: "_Call") -> None:
        batch = [first]
        try:
            if not self._tried:
                self._try_buckets(first)
            self._gather(batch)
            self._compute(batch)
        except Exception as error:
            if len(batch) == 1:
                raise
            # One of them may be to blame: each of them runs alone and learns its own fate.
            _logger.warning(
                "%s failed for %d calls at once, which now run alone: %r", self._label, len(batch), error
            )
        finally:  # also when this thread is made to end: the others must not wait for it
            self._leave(first)
            for call in batch[1:]:
                call.woken.put(None)

    def _gather(self, batch: list["_Call"]) -> None:
        """Add to the first call whoever in line is of its shape and has room beside it, in their order."""
        first, left = batch[0], deque[_Call]()
        rows = first.rows
        with self._lock:
            for call in self._line:
                if call.shape == first.shape and rows + call.rows <= self.largest:
                    batch.append(call)
                    rows += call.rows
                else:
                    left.append(call)
            self._line = left
            self.runs += 1
            self.rows += rows

    def _compute(self, batch: Sequence["_Call"]) -> None:
        rows = sum(call.rows for call in batch)
        padded = self._padded(rows)
        outputs = self._run(_joined([call.inputs for call in batch], padded - rows))
        if padded == batch[0].rows:
            batch[0].outputs = outputs
            return
        self._check_rows(outputs, padded)
        end = 0
        for call in batch:
            start, end = end, end + call.rows
            call.outputs = [output[start:end] for output in outputs]

    def _padded(self, rows: int) -> int:
        """The least bucket that holds so many rows; beyond the largest, a multiple of it."""
        fits = (bucket for bucket in self._buckets if bucket >= rows)
        return next(fits, -(-rows // self.largest) * self.largest)

    def _try_buckets(self, call: "_Call") -> None:
        """Run the buckets, the least first, and keep those that work and, if they are measured, that pay."""
        kept, before = 1, math.inf
        for bucket in self._buckets:
            inputs = {name: np.resize(array, (bucket, *array.shape[1:])) for name, array in call.inputs.items()}
            try:
                self._check_rows(self._run(inputs), bucket)  # the first run of a shape also prepares the device
                share = self._seconds(inputs) / bucket
            except Exception as error:
                if bucket == 1 and not isinstance(error, _NoRowsError):
                    raise  # whatever is wrong with these inputs, it is for their caller to hear
                _logger.warning("%s is spared runs of %d rows and more: %r", self._label, bucket, error)
                break
            if self._measured and share >= PAYS_BELOW * before:
                break
            kept, before = bucket, share
        self._buckets = tuple(bucket for bucket in self._buckets if bucket <= kept)
        self._tried = True
        _logger.debug("%s takes up to %d rows a run", self._label, kept)

    def _seconds(self, inputs: Arrays) -> float:
        least = math.inf
        for _ in range(REPEATS if self._measured else 0):
            started = self._clock()
            self._run(inputs)
            least = min(least, self._clock() - started)
        return least

    def _check_rows(self, outputs: Sequence[np.ndarray], rows: int) -> None:
        if any(output.shape[:1] != (rows,) for output in outputs):
            shapes = ", ".join(str(list(output.shape)) for output in outputs)
            raise _NoRowsError(f"expected {rows} rows from {self._label} for as many, got {shapes}")


class _NoRowsError(ValueError):
    """The network has no answer of its own for each row."""


class _Call:
    """What one caller wants, and what its thread finds when it is woken."""

    def __init__(self, inputs: Arrays, rows: int) -> None:
        self.inputs = inputs
        self.rows = rows
        self.shape = {name: (array.dtype, array.shape[1:]) for name, array in inputs.items()}
        self.woken: queue.SimpleQueue[None] = queue.SimpleQueue()  # cheaper than an Event
        self.leads = False  # it has the network, and must hand it over
        self.outputs: list[np.ndarray] | None = None  # woken without: it runs alone


def _rows_of(inputs: Arrays) -> int:
    """Rows that all of the inputs have; 0 when they do not agree."""
    counts = {array.shape[:1] for array in inputs.values()}
    return counts.pop()[0] if len(counts) == 1 and () not in counts else 0


def _joined(calls: Sequence[Arrays], padding: int) -> Arrays:
    """All rows, one call after the other, and the last row so many times more: a network can take it."""
    if len(calls) == 1 and not padding:
        return calls[0]
    last = {name: np.repeat(array[-1:], padding, axis=0) for name, array in calls[-1].items()}
    return {name: np.concatenate([call[name] for call in (*calls, last)]) for name in last}
