"""Where a target is, and what it takes to be let in."""

import ssl
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from shipshape.errors import FileError, SettingsError


@dataclass(frozen=True, slots=True)
class Keys:
    """PEM files and the bearer token, for targets that want them; no CA: those that the machine trusts."""

    ca: Path | None = None
    certificate: Path | None = None
    key: Path | None = None
    token: str = ""

    def context(self) -> ssl.SSLContext:
        """For TLS over HTTP; raises FileError when a file cannot be used."""
        try:
            context = ssl.create_default_context(cafile=self.ca)
            if self.certificate is not None:
                context.load_cert_chain(self.certificate, self.key)
        except OSError as error:  # ssl.SSLError among them
            raise FileError(f"expected PEM files for TLS, got: {error}") from error
        return context


@dataclass(frozen=True, slots=True)
class Address:
    """A target as it is given on the command line."""

    scheme: str
    host: str  # with its port
    path: str
    keys: Keys = Keys()
    connections: int = 1

    @property
    def secure(self) -> bool:
        """Whether it wants TLS."""
        return self.scheme in ("grpcs", "grpcs+stream", "https", "oip+https", "oip+grpcs")

    @property
    def base_url(self) -> str:
        """Of a target over HTTP, without a path."""
        return f"http{'s' if self.secure else ''}://{self.host}"


def parse_address(url: str, keys: Keys, connections: int) -> Address:
    """The address in a URL.

    Raises:
        SettingsError: It has no scheme, host or port.
    """
    try:
        parts = urlsplit(url)
        complete = bool(parts.scheme and parts.hostname and parts.port)
    except ValueError:  # a port that is no number
        complete = False
    if not complete:
        raise SettingsError(f"expected a target like grpc://127.0.0.1:50051, got {url!r:.80}")
    return Address(parts.scheme, parts.netloc, parts.path.strip("/"), keys, connections)
