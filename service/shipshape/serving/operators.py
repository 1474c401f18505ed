"""The operators' own doors, both off unless asked for: health in plain HTTP, admin behind a token."""

from collections.abc import Callable

from prometheus_client import CollectorRegistry

from shipshape.serving.admin.app import build_admin_app
from shipshape.serving.admin.control import Control
from shipshape.serving.health import Health
from shipshape.serving.rest.probes import build_probe_app
from shipshape.serving.rest.server import RestDoor
from shipshape.serving.tokens import Tokens
from shipshape.settings import Settings

LAST_CALL_S = 1.0  # for an operator's call that is under way when everything else has stopped


class OperatorDoors:
    """Listen before the first request can come and until the last one is answered.

    Args:
        settings: Say which of them there are.
        health: What the probes are told.
        registry: The metrics beside the probes.
        control: What the admin door may do.
        on_death: Called when one of them ends without having been asked to.

    Raises:
        SettingsError: The admin door's token file cannot be used.
    """

    def __init__(
        self,
        settings: Settings,
        *,
        health: Health,
        registry: CollectorRegistry,
        control: Control,
        on_death: Callable[[], None],
    ) -> None:
        self._settings = settings
        self._health = RestDoor(build_probe_app(health, registry), None, on_death=on_death, name="health")
        self._admin: RestDoor | None = None
        if settings.admin_token_file is not None:
            app = build_admin_app(control, Tokens(settings.admin_token_file))
            self._admin = RestDoor(app, None, on_death=on_death, name="admin")

    def start(self) -> tuple[int | None, int | None]:
        """Listen; the real ports of health and admin, None for one that is off.

        Raises:
            OSError: An address cannot be bound.
        """
        settings = self._settings
        health_port = admin_port = None
        if settings.health_port is not None:
            health_port = self._health.start(settings.health_host, settings.health_port)
        if settings.admin_port is not None and self._admin is not None:
            admin_port = self._admin.start(settings.admin_host, settings.admin_port)
        return health_port, admin_port

    def stop(self) -> None:
        """Accept no more."""
        for door in (self._admin, self._health):
            if door is not None:
                door.stop(LAST_CALL_S)
