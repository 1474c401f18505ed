"""Bearer tokens: who holds one, by a file of names and hashes.

A line is NAME SHA256HEX; # begins a comment. A token is 32 random bytes: nobody can try them all, so a plain hash
keeps it as safe as a slow one with salt, which is for passwords, and costs microseconds a request.
"""

import hashlib
import hmac
import re
import secrets
import time
from collections.abc import Callable
from pathlib import Path

from shipshape.errors import SettingsError
from shipshape.serving.reloading import Reloaded

TOKEN_BYTES = 32
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_HASH = re.compile(r"[0-9a-f]{64}")
Holders = tuple[tuple[str, str], ...]  # hash and name; a name may have several tokens


class Tokens:
    """The holders in a file, which is read again within a second of a change.

    Args:
        path: The file.
        clock: Monotonic seconds.

    Raises:
        SettingsError: The file cannot be read or is not of the form above.
    """

    def __init__(self, path: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._holders = Reloaded([path], lambda: _read(path), clock)

    def name_of(self, presented: str) -> str | None:
        """Whose token this is; None for a token that nobody holds. Takes as long whatever is presented."""
        digest, found = hash_of(presented), None
        for known, name in self._holders.get():
            if hmac.compare_digest(digest, known):
                found = name
        return found


def fresh_token() -> str:
    """A token that nobody has had before."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def hash_of(token: str) -> str:
    """What the file holds of a token: SHA-256, hexadecimal."""
    return hashlib.sha256(token.encode()).hexdigest()


def check_name(name: str) -> str:
    """The name, if it can stand in the file; raises SettingsError."""
    if not _NAME.fullmatch(name):
        raise SettingsError(f"expected a name of up to 64 letters, digits, '.', '_' and '-', got {name!r:.80}")
    return name


def parse_tokens(text: str, where: str) -> Holders:
    """Hash and name of each line.

    Raises:
        SettingsError: A line that is neither empty, a comment nor NAME SHA256HEX, or one token under two names. It
            quotes no line: somebody may have written the token itself.
    """
    names: dict[str, str] = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if len(words) != 2 or not _NAME.fullmatch(words[0]) or not _HASH.fullmatch(words[1].lower()):
            raise SettingsError(f"expected NAME SHA256HEX in line {number} of {where}, got something else")
        name = names.setdefault(words[1].lower(), words[0])
        if name != words[0]:
            raise SettingsError(f"expected one name a token in {where}, got line {number} with that of {name}")
    return tuple(names.items())


def _read(path: Path) -> Holders:
    try:
        return parse_tokens(path.read_text(encoding="utf-8"), str(path))
    except OSError as error:
        raise SettingsError(f"expected a tokens file at {path}, got: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SettingsError(f"expected text in the tokens file {path}, got bytes that are none") from error
