"""Every error of the product, each tied to an arrow of the data path; no transport codes in here.

ShipshapeError
|-- InvalidInput          bytes -> contact: the caller sent something else than was asked for
|   |-- TooLarge          more bytes, points or contacts than the limits allow
|   `-- Unprocessable     well-formed, but not a vessel's cluster (NaN, too few points, too wide)
|-- Overloaded            contact -> executor: no place or no time left, or over the caller's share
|-- DeadlineExceeded      executor -> stages: the answer would come too late
|-- Cancelled             executor -> stages: the caller left
|-- NotReady              the service is starting or stopping
|-- Unauthenticated       caller -> service: a token that is asked for is missing or unknown
|-- Unreachable           caller -> service: no service answers at an address
|-- ServiceFault          service -> caller: it failed, or it is no service of ours
|-- Conflict              operator -> service: the call does not fit the state it is in
|-- BundleError           files -> models: the bundle is missing, damaged or of another shape
|-- FileError             file -> clusters: the file cannot be read
`-- SettingsError         environment or command line -> settings: unknown, or a value that cannot work

A message is one sentence that says what was expected and what came. It is safe to show to a caller.
"""


class ShipshapeError(Exception):
    """Base of all errors that Shipshape raises on purpose."""


class InvalidInput(ShipshapeError):
    """The request is not of the promised form."""


class TooLarge(InvalidInput):
    """The request exceeds a limit on bytes, points or contacts."""


class Unprocessable(InvalidInput):
    """The request is well-formed but its points cannot be one vessel's cluster."""


class Overloaded(ShipshapeError):
    """No place or no time behind all that waits; the caller may come back after `retry_after_s`, if known."""

    def __init__(self, message: str, *, retry_after_s: float | None = None) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class DeadlineExceeded(ShipshapeError):
    """The deadline passed before the answer was computed."""


class Cancelled(ShipshapeError):
    """The caller cancelled before the answer was computed."""


class NotReady(ShipshapeError):
    """The service is still warming up, or stopping."""


class Unauthenticated(ShipshapeError):
    """The caller has not shown who it is."""


class Unreachable(ShipshapeError):
    """No service answers at an address, or the connection to it broke."""


class ServiceFault(ShipshapeError):
    """A service failed, and its log says why; or what answered is no service of ours."""


class Conflict(ShipshapeError):
    """An operator's call does not fit the state that the service is in."""


class BundleError(ShipshapeError):
    """The model bundle is missing, damaged, or not of the shape its manifest promises."""


class FileError(ShipshapeError):
    """A cluster file cannot be read."""


class SettingsError(ShipshapeError):
    """A setting is unknown or has a value that cannot work."""
