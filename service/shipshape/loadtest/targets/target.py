"""What the tool needs of a protocol."""

from dataclasses import dataclass
from typing import Any, Protocol

from shipshape.errors import ShipshapeError
from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Reply

CONNECT_S = 10.0  # that a target may take to let us in

Payload = Any  # a request as its own protocol sends it, ready beforehand; only the target that made it reads it


class TargetError(ShipshapeError):
    """The target cannot be tested: nobody there, or somebody else."""


@dataclass(frozen=True, slots=True)
class TargetInfo:
    """What a target says of itself; empty where it says nothing."""

    version: str = ""
    bundle_name: str = ""
    bundle: str = ""  # sha256
    budget_ms: float | None = None


class Target(Protocol):
    """A service behind one protocol. Used on one event loop alone."""

    async def open(self) -> TargetInfo:
        """Connect, and ask what it is.

        Raises:
            TargetError: Nobody answers, or in another protocol.
        """
        ...

    def encode(self, request: Request) -> Payload:
        """The request as it will be sent."""
        ...

    async def send(self, payload: Payload, deadline_s: float) -> Reply:
        """Send one request and wait for its end, whatever it is."""
        ...

    async def close(self) -> None:
        """Disconnect."""
        ...
