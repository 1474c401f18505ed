"""The page that the service serves at `/`, as `make console` builds it from the sources in `console/`."""

from collections.abc import Mapping
from pathlib import Path

ROOT, FOLDER = "/", "/console"  # the page, and below FOLDER all that it loads
PAGE = "index.html"

# Only what the service itself serves: no script or style within the page, and nothing of anybody else.
POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self'",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",  # asked again each time: a page of one version must not load scripts of another
}


def built() -> Path | None:
    """The folder of the built page; None where it was not built."""
    folder = Path(__file__).parent / "static"
    return folder if (folder / PAGE).is_file() else None


def is_open(path: str) -> bool:
    """Whether a path is one of the page's own; they hold no secrets, and the page itself asks for the token."""
    return path == ROOT or path.startswith(f"{FOLDER}/")
