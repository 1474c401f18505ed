"""What an operator may do: look, change the bundle, take it back, send traffic away and have it back."""

import time
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from shipshape.errors import Conflict, InvalidInput
from shipshape.executor import Executor
from shipshape.serving.health import Health, State
from shipshape.serving.models import Models, Placed
from shipshape.serving.shadow_metrics import Verdict

Json = dict[str, Any]


class Control:
    """The calls of the admin door; each answers with what `status` shows then.

    Args:
        health: Drained and resumed.
        models: Swapped and rolled back.
        executor: Counted.
        root: Bundles may be taken from folders below it alone.
    """

    def __init__(self, health: Health, models: Models, executor: Executor, root: Path) -> None:
        self._health = health
        self._models = models
        self._executor = executor
        self._root = root
        self._start = time.monotonic()

    def status(self) -> Json:
        """State, bundles, and what became of all contacts so far."""
        health, executor = self._health, self._executor
        counts = executor.counts()
        return {
            "state": health.state,
            "started": health.started,
            "live": health.live,
            "ready": health.ready,
            "version": version("shipshape"),
            "uptime_s": round(time.monotonic() - self._start, 3),
            "bundle": _bundle(self._models.running),
            "previous": _bundle(self._models.previous),
            "shadow": self._shadow(),
            "contacts": asdict(counts) | {"pending": counts.pending},
            "queue_depth": executor.queue_depth,
            "running": executor.running,
        }

    def swap(self, folder: str) -> Json:
        """Let the bundle in `folder` answer; absolute, or below the root.

        Raises:
            InvalidInput: The folder lies elsewhere.
            BundleError, Conflict, Cancelled: As `Models.swap`.
        """
        self._models.swap(folder_below(self._root, folder))
        return self.status()

    def rollback(self) -> Json:
        """Let the bundle before the running one answer again; raises as `Models.rollback`."""
        self._models.rollback()
        return self.status()

    def shadow(self, folder: str) -> Json:
        """Compare the bundle in `folder` with the running one; the folder and errors as of `swap`."""
        self._models.cast_shadow(folder_below(self._root, folder))
        return self.status()

    def unshadow(self) -> Json:
        """Unload the shadow; without one nothing changes. Raises Conflict as `Models.end_shadow`."""
        self._models.end_shadow()
        return self.status()

    def promote(self) -> Json:
        """Let the shadow answer; raises as `Models.promote`."""
        self._models.promote()
        return self.status()

    def drain(self) -> Json:
        """Not ready until `resume`, so that traffic moves away; what still comes is answered."""
        self._health.drain()
        return self.status()

    def resume(self) -> Json:
        """Ready again; raises Conflict when the service is stopping, which nothing takes back."""
        if self._health.state is State.STOPPING:
            raise Conflict("expected a running service, got one that is stopping")
        self._health.resume()
        return self.status()

    def _shadow(self) -> Json | None:
        if (bundle := _bundle(self._models.shadow)) is None:
            return None
        counts = self._models.comparing.counts()
        return bundle | {"compared": counts[Verdict.SAME] + counts[Verdict.DIFFERS]} | counts


def folder_below(root: Path, given: str) -> Path:
    """The folder that is meant, every link followed.

    Raises:
        InvalidInput: It is not below `root`, or not there at all.
    """
    try:
        top = root.resolve()
        folder = (top / given).resolve(strict=True)
    except (OSError, ValueError, RuntimeError) as error:  # not there; a NUL, a name too long, links in circles
        raise InvalidInput(
            f"expected a bundle folder below {top}, got {given!r:.80} which is not there"
        ) from error
    if top not in folder.parents:
        raise InvalidInput(f"expected a bundle folder below {top}, got {given!r:.200}")
    return folder


def _bundle(placed: Placed | None) -> Json | None:
    if placed is None:
        return None
    bundle = placed.model.bundle
    return {"name": bundle.name, "digest": bundle.digest, "folder": str(placed.folder)}
