"""The running model, the one before it and its shadow, changed under load.

A swap tries the new one out beside the running one, so that whatever is wrong with it, the running one goes on.
Requests keep the model they began with.
"""

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from shipshape.errors import BundleError, Cancelled, Conflict
from shipshape.serving.model import Model
from shipshape.serving.shadow import Shadow

Load = Callable[[Path], Model]  # raises BundleError

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Placed:
    """A model and the folder it was read from."""

    folder: Path
    model: Model


class Models:
    """At most four bundles are in memory: the running one, the one before, the shadow, and one being tried.

    Args:
        load: Reads and verifies a bundle, one network after the other.
        try_out: Runs whatever a request can ask for; raises what is wrong.
        publish: From here on requests are answered by this model; raises Cancelled when the service stops.
        comparing: Compares the shadow's answers.
    """

    def __init__(
        self, load: Load, try_out: Callable[[Model], None], publish: Callable[[Model], None], comparing: Shadow
    ) -> None:
        self._load = load
        self._try_out = try_out
        self._publish = publish
        self.comparing = comparing
        self._turn = threading.Lock()
        self.running: Placed | None = None
        self.previous: Placed | None = None
        self.shadow: Placed | None = None

    def open(self, first: Placed) -> None:
        """Try the first model out and let it answer; raises whatever is wrong with it."""
        with self._alone():
            self._try_out(first.model)
            self._publish(first.model)
            self.running = first

    def swap(self, folder: Path) -> Placed:
        """Let the bundle in `folder` answer; the one before is kept for `rollback`.

        The bundle that runs already is left as it is, so that a call may be repeated.

        Raises:
            BundleError: It cannot be used; the running one goes on.
            Conflict: Another call is under way, or the service has no model yet.
            Cancelled: The service stops.
        """
        with self._alone():
            before = self._running()
            found = self._tried(folder, before)
            if found is not before:
                self._publish(found.model)
                self.running, self.previous = found, before
        return found

    def rollback(self) -> Placed:
        """Let the model before the running one answer again; a second call takes the first one back.

        Raises:
            Conflict: There is none, or another call is under way.
            Cancelled: The service stops.
        """
        with self._alone():
            before, back = self._running(), self.previous
            if back is None:
                raise Conflict("expected a bundle to roll back to, got a service that has run no other")
            self._publish(back.model)
            self.running, self.previous = back, before
        return back

    def cast_shadow(self, folder: Path) -> Placed:
        """Compare the bundle in `folder` with whichever runs, in the place of another one.

        Raises:
            BundleError, Conflict, Cancelled: As `swap`; nothing has changed.
        """
        with self._alone():
            before = self._running()
            found = self._tried(folder, before)
            self.comparing.begin(found.model, apart=found is not before)
            self.shadow = found
        return found

    def end_shadow(self) -> None:
        """Unload the shadow, if there is one; raises Conflict when another call is under way."""
        with self._alone():
            self.comparing.end()
            self.shadow = None

    def promote(self) -> Placed:
        """Let the shadow answer; the model before is kept for `rollback`.

        Raises:
            Conflict: There is none, it has lost workers, or another call is under way.
            Cancelled: The service stops.
        """
        with self._alone():
            before, found = self._running(), self.shadow
            if found is None:
                raise Conflict("expected a shadow to promote, got a service that has none: load it with shadow")
            self.comparing.end(promoted=True)
            self.shadow = None
            if found is not before:
                self._publish(found.model)
                self.running, self.previous = found, before
        return found

    def _running(self) -> Placed:
        if self.running is None:
            raise Conflict("expected a service that is ready, got one that is still starting")
        return self.running

    def _tried(self, folder: Path, before: Placed) -> Placed:
        try:
            model = self._load(folder)
            if model.bundle.digest == before.model.bundle.digest:
                model.close()
                return before
            self._try_out(model)
        except (BundleError, Cancelled):
            raise
        except Exception as error:  # a network may fail in any way: what matters is that it is not let in
            _logger.exception("the bundle in %s failed", folder)
            cause = " ".join(f"{type(error).__name__}: {error}".split())
            raise BundleError(f"expected the bundle to answer the built-in contact, got {cause:.160}") from error
        return Placed(folder, model)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        if not self._turn.acquire(blocking=False):
            raise Conflict("expected one change of the bundle at a time, got another one under way")
        try:
            yield
        finally:
            self._turn.release()
