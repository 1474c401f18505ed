"""The REST door as an ASGI application."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Any

from fastapi import FastAPI
from starlette.types import ASGIApp

from shipshape import console
from shipshape.serving.access import Access
from shipshape.serving.core import Core
from shipshape.serving.faults import FaultKind
from shipshape.serving.health import Health
from shipshape.serving.rest import contract
from shipshape.serving.rest.bodies import Bodies
from shipshape.serving.rest.console_routes import add_console
from shipshape.serving.rest.doorkeeper import Doorkeeper
from shipshape.serving.rest.farewell import Farewell
from shipshape.serving.rest.front import Front
from shipshape.serving.rest.json_process import JsonProcess
from shipshape.serving.rest.mailbox import Mailbox
from shipshape.serving.rest.oip_routes import OipRoutes
from shipshape.serving.rest.probes import add_probes
from shipshape.serving.rest.problems import add_handlers
from shipshape.serving.rest.routes import Routes
from shipshape.serving.rest.schemas import CapacityAnswer, ModelAnswer, RecognitionAnswer, ScanAnswer
from shipshape.serving.timing import Timeouts
from shipshape.telemetry import Metrics

RECOGNISE, SCAN = "/v1/recognise", "/v1/scan"
DESCRIPTION = """Recognises and restores vessels from LiDAR clusters.

Level frame: origin at the LiDAR, gravity-aligned, x ahead of the sensor's own vessel, y to port, z up. Metres;
radians, except where a name ends in _deg. Packed points are little-endian float32 x y z, 12 bytes a point.
"""


def build_app(core: Core, metrics: Metrics, timeouts: Timeouts, access: Access, health: Health) -> ASGIApp:
    """The application; it answers 503 until the core is open."""
    json = JsonProcess(core.limits)
    # The framework's documentation pages load scripts from elsewhere; the contract itself is at /openapi.json.
    app = FastAPI(
        title="Shipshape",
        version=version("shipshape"),
        description=DESCRIPTION,
        docs_url=None,
        redoc_url=None,
        lifespan=lambda _: _until_the_listener_ends(json),
    )
    bodies = Bodies(core.limits, json)
    routes = Routes(core, metrics, timeouts, access.clients, bodies)
    refusals = contract.problems(*(kind for kind in FaultKind if kind is not FaultKind.CANCELLED))
    not_ready = contract.problems(FaultKind.NOT_READY)
    stranger = contract.problems(FaultKind.UNAUTHENTICATED)

    def add(path: str, handler: Any, *methods: str, **more: Any) -> None:
        """One path; its name in the contract is that of its handler."""
        app.add_api_route(path, handler, methods=list(methods), operation_id=handler.__name__, **more)

    refusals |= contract.unsupported()
    add(RECOGNISE, routes.recognise, "POST", **_api(RecognitionAnswer, refusals, contract.recognise_extra()))
    add(SCAN, routes.scan, "POST", **_api(ScanAnswer, refusals, contract.scan_extra()))
    add("/v1/model", routes.model, "GET", **_api(ModelAnswer, not_ready | stranger, None))
    capacity_extra = contract.capacity_extra()
    add("/v1/capacity", routes.capacity, "GET", **_api(CapacityAnswer, not_ready | stranger, capacity_extra))
    add_probes(app, health, metrics.registry)
    app.router.routes.extend(OipRoutes(core, metrics, timeouts, access.clients, bodies, health).routes())
    add_console(app, console.built())
    add_handlers(app)
    contract.add_contract(app)
    front = Front(app, {RECOGNISE: routes.recognise, SCAN: routes.scan})
    return Farewell(Doorkeeper(front, access), health)


@asynccontextmanager
async def _until_the_listener_ends(json: JsonProcess) -> AsyncIterator[dict[str, Any]]:
    yield {"mailbox": Mailbox()}  # in the state of every request
    json.close()


def _api(answer: type, refusals: dict[int | str, dict[str, Any]], extra: dict[str, Any] | None) -> dict[str, Any]:
    return {"responses": {200: {"model": answer}, **refusals}, "openapi_extra": extra}
