"""What a request's headers say: the form of its body, and its deadline."""

from fastapi import HTTPException, Request

from shipshape.errors import InvalidInput
from shipshape.serving.timing import LONGEST_MS

TIMEOUT_HEADER = "Shipshape-Timeout-Ms"


def check_encoding(encoding: str | None) -> None:
    """Refuse a compressed body, with 415: a megabyte of it could be a gigabyte of points."""
    if encoding not in (None, "identity"):
        raise HTTPException(415, f"expected a body without content encoding, got {encoding:.40}")


def media_type(request: Request, *accepted: str) -> str:
    """The body's media type, one of `accepted`; anything else, and a compressed body, is 415."""
    check_encoding(request.headers.get("content-encoding"))
    given = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if given not in accepted:
        *others, last = accepted
        raise HTTPException(
            415, f"expected a body of type {', '.join(others)} or {last}, got {given or 'none'!s:.80}"
        )
    return given


def timeout_s(request: Request, default_ms: float) -> float:
    """Seconds that the caller gives this request.

    Raises:
        InvalidInput: The header is no number of milliseconds above 0.
    """
    text = request.headers.get(TIMEOUT_HEADER)
    try:
        milliseconds = default_ms if text is None else float(text)
    except ValueError:
        milliseconds = -1.0
    if not 0 < milliseconds <= LONGEST_MS:
        raise InvalidInput(f"expected {TIMEOUT_HEADER} above 0 and up to {LONGEST_MS:.0f}, got {text!r:.40}")
    return milliseconds / 1e3
