"""Where a service is, and what it takes to be let in."""

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import grpc

from shipshape.client.links import LAN, Link
from shipshape.errors import FileError, SettingsError
from shipshape.token_file import read_token


@dataclass(frozen=True, slots=True)
class Endpoint:
    """One service.

    Attributes:
        url: grpc://HOST:PORT, or grpcs://HOST:PORT for TLS.
        link: What the connection goes over.
        ca: PEM file of who signed the service's certificate; None: those that the machine trusts.
        certificate: PEM file of the own certificate, for a service that asks for one (mTLS); with key.
        key: PEM file of its key.
        token_file: File that holds the bearer token. Over grpc:// it goes out in clear.
    """

    url: str
    link: Link = LAN
    ca: Path | None = None
    certificate: Path | None = None
    key: Path | None = None
    token_file: Path | None = None

    def __post_init__(self) -> None:
        try:
            parts = urlsplit(self.url)
            complete = parts.scheme in ("grpc", "grpcs") and parts.hostname and parts.port and not parts.path
        except ValueError:  # a port that is no number
            complete = False
        if not complete:
            raise SettingsError(f"expected an endpoint like grpc://127.0.0.1:50051, got {self.url!r:.80}")
        if (self.certificate is None) != (self.key is None):
            raise SettingsError("expected both certificate and key of an endpoint, got one of them")
        if not self.secure and (self.ca or self.certificate):
            raise SettingsError(f"expected grpcs:// beside ca or certificate, got {self.url!r:.80}")

    @property
    def secure(self) -> bool:
        """Whether it wants TLS."""
        return self.url.startswith("grpcs:")

    def open(self) -> grpc.aio.Channel:
        """A channel, for the running event loop.

        Raises:
            FileError: A PEM file cannot be read.
        """
        address, options = urlsplit(self.url).netloc, self.link.channel_options()
        if not self.secure:
            return grpc.aio.insecure_channel(address, options, self.link.compression)
        pem = [None if path is None else _read(path) for path in (self.ca, self.key, self.certificate)]
        return grpc.aio.secure_channel(address, grpc.ssl_channel_credentials(*pem), options, self.link.compression)

    def metadata(self) -> tuple[tuple[str, str], ...]:
        """What every call brings: the token, read anew, so that a file that was changed holds at once.

        Raises:
            FileError: The token cannot be read.
        """
        if self.token_file is None:
            return ()
        return (("authorization", f"Bearer {read_token(self.token_file)}"),)


def as_endpoint(given: "Endpoint | str") -> Endpoint:
    """An endpoint, also of a bare URL; raises SettingsError for one that is none."""
    return given if isinstance(given, Endpoint) else Endpoint(given)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise FileError(f"expected PEM in {path.name}, got: {error.strerror}") from error
