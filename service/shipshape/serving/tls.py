"""Files of certificates -> TLS for both doors; proven before a port opens, read again when they change."""

import ssl
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from shipshape.errors import SettingsError
from shipshape.serving.reloading import Reloaded


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """PEM files."""

    certificate: Path  # followed by its intermediate certificates
    key: Path  # not encrypted
    client_ca: Path | None = None  # None asks clients for no certificate


@dataclass(frozen=True, slots=True, eq=False)
class TlsMaterial:
    """What the files held at one moment."""

    certificate: bytes  # PEM, as the rest
    key: bytes
    client_ca: bytes | None
    context: ssl.SSLContext  # of the same, for a server


class Tls:
    """TLS 1.2 or newer for both doors; a client must show a certificate when `client_ca` is among the files.

    Args:
        files: Read again within a second of a change; what cannot be used leaves the last good ones.
        clock: Monotonic seconds.

    Raises:
        SettingsError: A file cannot be read, or no client could use what they hold: another certificate's key, a
            certificate out of date, not for servers, or too weak.
    """

    def __init__(self, files: TlsFiles, clock: Callable[[], float] = time.monotonic) -> None:
        paths = [files.certificate, files.key, *([files.client_ca] if files.client_ca else [])]
        self._newest = Reloaded(paths, lambda: _load(files), clock)
        self.asks_clients = files.client_ca is not None

    def newest(self) -> TlsMaterial:
        """What the files hold now."""
        return self._newest.get()

    def context(self) -> ssl.SSLContext:
        """A server's context that hands each new connection what the files hold by then."""

        def renew(connection: ssl.SSLObject, _name: str | None, _context: ssl.SSLContext) -> None:
            """Show the newest certificate in the handshake that begins."""
            connection.context = self.newest().context

        context = self.newest().context
        context.sni_callback = renew  # called at the start of each handshake, also when the client names no server
        return context


def _load(files: TlsFiles) -> TlsMaterial:
    certificate, key = _read(files.certificate), _read(files.key)
    client_ca = None if files.client_ca is None else _read(files.client_ca)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(
            files.certificate, files.key, password=""
        )  # else OpenSSL asks the terminal for one
        _try_handshake(context, files.certificate)
    except OSError as error:  # of TLS, or of a file that has just been moved away
        raise SettingsError(
            f"expected a server's valid certificate in {files.certificate} and its key in {files.key}, "
            f"got: {_complaint(error)}"
        ) from error
    if files.client_ca is not None:
        _demand_certificates(context, files.client_ca)
    return TlsMaterial(certificate, key, client_ca, context)


def _try_handshake(server: ssl.SSLContext, certificate: Path) -> None:
    """Raises ssl.SSLError unless a client that trusts this very certificate comes to terms with `server`."""
    client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    client.check_hostname = False  # which name callers use is not known here
    client.verify_flags |= ssl.VerifyFlags.VERIFY_X509_PARTIAL_CHAIN
    client.load_verify_locations(certificate)
    to_client, to_server = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = client.wrap_bio(to_client, to_server), server.wrap_bio(to_server, to_client, server_side=True)
    for end in ends * 2:
        with suppress(ssl.SSLWantReadError):
            end.do_handshake()


def _demand_certificates(context: ssl.SSLContext, client_ca: Path) -> None:
    try:
        context.load_verify_locations(client_ca)
    except OSError as error:
        raise SettingsError(
            f"expected certificates of authorities in {client_ca}, got: {_complaint(error)}"
        ) from error
    ends = [ssl.cert_time_to_seconds(str(authority["notAfter"])) for authority in context.get_ca_certs()]
    if not ends or max(ends) < time.time():
        found = "only expired ones" if ends else "none"
        raise SettingsError(f"expected certificates of authorities in {client_ca}, got {found}")
    context.verify_mode = ssl.VerifyMode.CERT_REQUIRED
    context.num_tickets = 0  # who takes a session up again shows no certificate; TLS 1.2 still can, for two hours


def _complaint(error: OSError) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return str(error.verify_message)
    if isinstance(error, ssl.SSLError):
        return str(error.reason or error).replace("_", " ").lower()
    return str(error.strerror)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SettingsError(f"expected a PEM file at {path}, got: {error.strerror}") from error
