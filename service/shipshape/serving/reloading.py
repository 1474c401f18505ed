"""A value made of files, made again when they change, so that tokens and certificates change without a restart."""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Generic, TypeVar

from shipshape.errors import SettingsError

LOOK_S = 1.0  # between two looks at the files; what was taken out of one is refused after at most this long
T = TypeVar("T")
_logger = logging.getLogger(__name__)


class Reloaded(Generic[T]):
    """The newest value that could be read; a change that cannot be read leaves the last good one and is logged.

    Args:
        paths: The files that the value is made of.
        read: Makes it; raises SettingsError.
        clock: Monotonic seconds.

    Raises:
        SettingsError: `read` did, at the start.
    """

    def __init__(
        self, paths: Sequence[Path], read: Callable[[], T], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._paths = paths
        self._read = read
        self._clock = clock
        self._stamps = self._look()  # before the files are read: what changes meanwhile is read again
        self._value = read()
        self._looked = clock()
        self._complaint = ""
        self._lock = threading.Lock()

    def get(self) -> T:
        """The value; looks for changes at most once in `LOOK_S` seconds. Safe from all threads."""
        if self._clock() - self._looked >= LOOK_S and self._lock.acquire(blocking=False):
            try:
                self._renew()
            finally:
                self._lock.release()
        return self._value

    def _renew(self) -> None:
        self._looked = self._clock()
        stamps = self._look()
        if stamps == self._stamps:
            return
        try:
            self._value = self._read()
        except SettingsError as error:  # the next look tries again: it may have been half written
            if str(error) != self._complaint:
                self._complaint = str(error)
                _logger.error("a changed file is not used, the last good one still holds: %s", error)
            return
        self._stamps, self._complaint = stamps, ""
        _logger.info("read again: %s", ", ".join(map(str, self._paths)))

    def _look(self) -> list[tuple[int, int, int] | None]:
        return [_stamp(path) for path in self._paths]


def _stamp(path: Path) -> tuple[int, int, int] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino
