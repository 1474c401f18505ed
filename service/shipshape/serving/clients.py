"""Who asks, and how much each of them may ask, so that one client's flood is not the others' famine."""

import ipaddress
import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

from shipshape.errors import Overloaded

MOST_CLIENTS = 4096  # remembered; beyond, those that have asked nothing for longest begin anew
IPV6_PREFIX = 64  # bits: what one site is given, and may choose its addresses from
RATE, UNDER_WAY = "rate", "under_way"  # why a client was refused

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ClientLimits:
    """What one client may ask; 0 sets no limit."""

    contacts_per_s: float = 0.0
    burst: int = 512  # contacts at once, after a rest
    under_way: int = 0  # contacts waiting or being computed


def client_name(token: str | None, certificate: str | None, address: str) -> str:
    """The name that limits hold for: the token's, else the certificate's, else the address.

    Args:
        token: Name of the token that was presented.
        certificate: Name in the certificate that was presented and verified.
        address: Where the connection comes from; of IPv6 only the network counts.
    """
    if token is not None:
        return f"token {token}"
    if certificate is not None:
        return f"certificate {certificate}"
    return f"address {_site(address)}"


class Clients:
    """What each client has left of its limits.

    Args:
        limits: Hold for each.
        on_refusal: Told why a client was refused, `RATE` or `UNDER_WAY`.
        clock: Monotonic seconds.
    """

    def __init__(
        self,
        limits: ClientLimits,
        on_refusal: Callable[[str], None] = lambda reason: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._limits = limits
        self._on_refusal = on_refusal
        self._clock = clock
        self._limited = bool(limits.contacts_per_s or limits.under_way)  # else there is nothing to count
        self._accounts: OrderedDict[str, _Account] = OrderedDict()  # least recently used first
        self._lock = threading.Lock()

    def share(self, client: str) -> "Share":
        """What a request of `client` takes, for a `with` block: it is given back at the end of the block."""
        return Share(self, client)

    def take(self, client: str, contacts: int) -> None:
        """Count `contacts` of `client` as under way; refused ones cost nothing.

        Raises:
            Overloaded: Over a limit; with the seconds after which the rate would let them pass.
        """
        if not self._limited:
            return
        with self._lock:
            account = self._account(client)
            refusal = self._over(account, contacts)
            if refusal is None:
                account.left -= contacts
                account.under_way += contacts
                return
        reason, error = refusal
        _logger.debug("refused %s: %s", client, error)
        self._on_refusal(reason)
        raise error

    def give_back(self, client: str, contacts: int) -> None:
        """`contacts` that were taken are no longer under way."""
        if not self._limited:
            return
        with self._lock:
            self._accounts[client].under_way -= contacts  # none with contacts under way is forgotten

    def _over(self, account: "_Account", contacts: int) -> tuple[str, Overloaded] | None:
        limits = self._limits
        if limits.under_way and account.under_way + contacts > limits.under_way:
            return UNDER_WAY, Overloaded(
                f"expected at most {limits.under_way} contacts of one client under way, "
                f"got {contacts} beside {account.under_way}"
            )
        if limits.contacts_per_s and contacts > account.left:
            seconds = (contacts - account.left) / limits.contacts_per_s
            return RATE, Overloaded(
                f"expected at most {limits.contacts_per_s:g} contacts a second of one client, {limits.burst} at "
                f"once, got {contacts} more: there will be room in {seconds:.3g} s",
                retry_after_s=seconds,
            )
        return None

    def _account(self, client: str) -> "_Account":
        now, limits = self._clock(), self._limits
        if client not in self._accounts:
            self._make_room()
            self._accounts[client] = _Account(limits.burst, now)
        account = self._accounts[client]
        self._accounts.move_to_end(client)
        account.left = min(limits.burst, account.left + (now - account.at) * limits.contacts_per_s)
        account.at = now
        return account

    def _make_room(self) -> None:
        if len(self._accounts) >= MOST_CLIENTS:
            # Those with contacts under way stay; the queue bounds how many there are.
            idle = (name for name, account in self._accounts.items() if not account.under_way)
            self._accounts.pop(next(idle, ""), None)


class Share:
    """What one request has taken of its client's limits."""

    def __init__(self, clients: Clients, client: str) -> None:
        self._clients = clients
        self._client = client
        self._taken = 0

    def take(self, contacts: int) -> None:
        """Take `contacts` more; raises Overloaded as `Clients.take` does."""
        self._clients.take(self._client, contacts)
        self._taken += contacts

    def __enter__(self) -> "Share":
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self._taken:
            self._clients.give_back(self._client, self._taken)


@dataclass(slots=True)
class _Account:
    left: float  # contacts that may come at once
    at: float  # when that was so, seconds
    under_way: int = 0


def _site(address: str) -> str:
    try:
        version = ipaddress.ip_address(address).version
    except ValueError:  # a Unix socket, or an address with a zone
        return address
    return str(ipaddress.ip_network((address, IPV6_PREFIX), strict=False)) if version == 6 else address
