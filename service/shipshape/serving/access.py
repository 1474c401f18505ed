"""Who may come in through the doors: TLS, tokens and the limits of each client, as the settings say."""

import ipaddress
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from shipshape.errors import Unauthenticated
from shipshape.serving.clients import ClientLimits, Clients, client_name
from shipshape.serving.tls import Tls, TlsFiles
from shipshape.serving.tokens import Tokens
from shipshape.settings import PREFIX, Settings

TOKEN = "token"  # why a caller was refused, beside the reasons of `clients`
OTHERS = 0o007  # of a file's mode: what everybody on the machine may do

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Access:
    """The same for both doors; as it stands here, it lets everybody in and everything pass."""

    tls: Tls | None = None
    tokens: Tokens | None = None
    clients: Clients = field(default_factory=lambda: Clients(ClientLimits()))
    on_refusal: Callable[[str], None] = lambda reason: None

    def holder(self, authorizations: Sequence[str]) -> str | None:
        """The name of the token that was presented; None when no token is asked for.

        Args:
            authorizations: All values that the request gives of `authorization`.

        Raises:
            Unauthenticated: Not one value of the form "Bearer TOKEN", or a token that nobody holds.
        """
        if self.tokens is None:
            return None
        scheme, _, token = authorizations[0].partition(" ") if len(authorizations) == 1 else ("", "", "")
        if scheme.lower() != "bearer":
            self.on_refusal(TOKEN)
            raise Unauthenticated(
                f"expected authorization: Bearer TOKEN once, got {'another form' if authorizations else 'none'}"
            )
        name = self.tokens.name_of(token.strip())
        if name is None:
            self.on_refusal(TOKEN)
            raise Unauthenticated("expected a token that this service knows, got another")
        return name

    def client(self, authorizations: Sequence[str], certificate: str | None, address: str) -> str:
        """The name that limits hold for: see `client_name` and `holder`."""
        return client_name(self.holder(authorizations), certificate, address)


def load_access(settings: Settings, on_refusal: Callable[[str], None]) -> Access:
    """What the settings ask for; what they leave open to others is logged.

    Args:
        settings: See there.
        on_refusal: Told why a caller was refused: `TOKEN`, or a reason of `clients`.

    Raises:
        SettingsError: A file cannot be used.
    """
    limits = ClientLimits(settings.client_contacts_per_s, settings.client_burst, settings.client_under_way)
    access = Access(
        tls=_tls(settings),
        tokens=None if settings.tokens_file is None else Tokens(settings.tokens_file),
        clients=Clients(limits, on_refusal),
        on_refusal=on_refusal,
    )
    for warning in exposures(settings):
        _logger.warning(warning)
    return access


def exposures(settings: Settings) -> list[str]:
    """A sentence for each thing that the settings leave open to others."""
    found = []
    if not _is_loopback(settings.host):
        where = f"on {settings.host}, which is not loopback"
        if settings.tls_certificate is None:
            found.append(f"expected TLS {where}, got none: whoever is on the way can read and change everything")
        if settings.tokens_file is None and settings.tls_client_ca is None:
            found.append(f"expected tokens or client certificates {where}, got neither: everybody may ask")
    for name in ("tls_key", "tokens_file"):
        path: Path | None = getattr(settings, name)
        if path is not None and path.stat().st_mode & OTHERS:
            found.append(
                f"expected {PREFIX}{name.upper()} closed to other users, got {path} open: chmod o= {path}"
            )
    return found


def _tls(settings: Settings) -> Tls | None:
    if settings.tls_certificate is None or settings.tls_key is None:
        return None
    return Tls(TlsFiles(settings.tls_certificate, settings.tls_key, settings.tls_client_ca))


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
