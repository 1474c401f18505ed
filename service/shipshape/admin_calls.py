"""The calls of `shipshape admin`: one request to the admin door of a service, its answer on stdout."""

import argparse
import http.client
import json
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager

from shipshape.errors import SettingsError
from shipshape.token_file import read_token

OK, REFUSED = 0, 1
PATIENCE_S = 120.0  # a swap loads and tries a whole bundle, on a loaded machine
TICK_S = 1.0  # between two looks at the clock for somebody who waits
NEXT = "is --url the address of the service's SHIPSHAPE_ADMIN_PORT?"
CALLS = {
    "status": ("GET", "/admin/status"),
    "swap": ("POST", "/admin/bundle"),
    "rollback": ("POST", "/admin/rollback"),
    "shadow": ("POST", "/admin/shadow"),
    "unshadow": ("POST", "/admin/unshadow"),
    "promote": ("POST", "/admin/promote"),
    "drain": ("POST", "/admin/drain"),
    "resume": ("POST", "/admin/resume"),
}


def admin(arguments: argparse.Namespace) -> int:
    """Make one call; 1 when the service refused it or cannot be reached."""
    method, path = CALLS[arguments.call]
    # A call that needs a folder has one: `cli` says which.
    body = json.dumps({"folder": str(arguments.folder)}).encode() if "folder" in arguments else None
    request = urllib.request.Request(_url(arguments.url) + path, body, method=method)
    request.add_header("Authorization", f"Bearer {read_token(arguments.token_file)}")
    request.add_header("Content-Type", "application/json")
    # No proxy: the door is on loopback, and whatever the environment names would learn the token.
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        with _counted(arguments.call), opener.open(request, timeout=PATIENCE_S) as response:
            answer = json.load(response)
        print(json.dumps(answer, indent=2))
    except urllib.error.HTTPError as error:
        with error:
            return _failed(_detail(error))
    except OSError as error:  # URLError is one
        return _failed(
            f"expected an admin door at {arguments.url}, got: {getattr(error, 'reason', error)}: {NEXT}"
        )
    except (http.client.HTTPException, ValueError) as error:
        return _failed(f"expected an admin door at {arguments.url}, got {type(error).__name__}: {NEXT}")
    return OK


@contextmanager
def _counted(call: str) -> Iterator[None]:
    """The seconds that a call takes, where somebody looks on."""
    if not sys.stderr.isatty():
        yield
        return
    started, ended = time.monotonic(), threading.Event()

    def count() -> None:
        """Write them over each other."""
        while not ended.wait(TICK_S):
            print(f"\r{call}: {time.monotonic() - started:.0f} s", end="", file=sys.stderr, flush=True)

    counting = threading.Thread(target=count, daemon=True)
    counting.start()
    try:
        yield
    finally:
        ended.set()
        counting.join()
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def _url(given: str) -> str:
    if not given.startswith(("http://", "https://")):
        raise SettingsError(f"expected --url to begin with http:// or https://, got {given!r:.80}")
    return given.rstrip("/")


def _detail(error: urllib.error.HTTPError) -> str:
    try:
        return str(json.load(error)["detail"])
    except (ValueError, KeyError, TypeError):
        return f"expected an answer of an admin door, got status {error.code}"


def _failed(sentence: str) -> int:
    print(f"shipshape: {sentence}", file=sys.stderr)
    return REFUSED
