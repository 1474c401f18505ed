"""What a request's headers say: the form of its body, and its deadline."""

from fastapi import HTTPException

from shipshape.errors import InvalidInput
from shipshape.serving.timing import LONGEST_MS

TIMEOUT_HEADER = "Shipshape-Timeout-Ms"
TIMEOUT_NAME = TIMEOUT_HEADER.lower().encode()  # as a request brings it


def check_encoding(header: str | None) -> None:
    """Refuse a compressed body, with 415: a megabyte of it could be a gigabyte of points."""
    if header not in (None, "identity"):
        raise HTTPException(415, f"expected a body without content encoding, got {header:.40}")


def media_type(header: str | None, *accepted: str) -> str:
    """The body's media type by its Content-Type, one of `accepted`; anything else is 415."""
    given = (header or "").partition(";")[0].strip().lower()
    if given not in accepted:
        *others, last = accepted
        raise HTTPException(
            415, f"expected a body of type {', '.join(others)} or {last}, got {given or 'none'!s:.80}"
        )
    return given


def timeout_s(header: str | None, default_ms: float) -> float:
    """Seconds that the caller gives this request, by its `TIMEOUT_HEADER`.

    Raises:
        InvalidInput: The header is no number of milliseconds above 0.
    """
    try:
        milliseconds = default_ms if header is None else float(header)
    except ValueError:
        milliseconds = -1.0
    if not 0 < milliseconds <= LONGEST_MS:
        raise InvalidInput(f"expected {TIMEOUT_HEADER} above 0 and up to {LONGEST_MS:.0f}, got {header!r:.40}")
    return milliseconds / 1e3
