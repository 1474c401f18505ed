"""The bearer token that somebody holds, in a file: never on a command line, where everybody can see it."""

from pathlib import Path

from shipshape.errors import FileError


def read_token(file: Path) -> str:
    """The token, without the space around it.

    Raises:
        FileError: It cannot be read, or holds something else.
    """
    try:
        return file.read_text(encoding="ascii").strip()
    except OSError as error:
        raise FileError(f"expected to read a token from {file.name}, got: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise FileError(f"expected a token in {file.name}, got bytes that are none") from error
