"""How kernels are compiled: to run without the interpreter's lock, and kept on disk where the disk takes them."""

import logging
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

from numba import njit
from numba.core.caching import FunctionCache

F = TypeVar("F", bound=Callable[..., Any])
_logger = logging.getLogger(__name__)


class _Kept(FunctionCache):
    def save_overload(self, signature: Any, data: Any) -> None:
        """A full disk costs the next start some seconds, and not this one its life."""
        try:
            super().save_overload(signature, data)  # type: ignore[no-untyped-call]  # numba has few types
        except OSError as error:
            _complain(str(error))


@cache
def _complain(words: str) -> None:
    """Once, not for each kernel."""
    _logger.warning("compiled kernels are not kept, the next start compiles again: %s", words)


def compiled(function: F) -> F:
    """The function, which numba compiles when it is first called."""
    dispatcher: Any = njit(nogil=True)(function)
    dispatcher._cache = _Kept(function)  # type: ignore[no-untyped-call]  # as njit(cache=True), with numba's own
    kernel: F = dispatcher
    return kernel
