"""What probes and scrapers ask: on the REST door, and in plain HTTP on a port of their own."""

from importlib.metadata import version

from fastapi import FastAPI, Request, Response
from fastapi.responses import PlainTextResponse
from prometheus_client import CollectorRegistry
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
from starlette.concurrency import run_in_threadpool

from shipshape.errors import NotReady
from shipshape.serving.faults import FaultKind, fault_of
from shipshape.serving.health import Health
from shipshape.serving.rest import contract
from shipshape.serving.rest.problems import add_handlers, identify, problem
from shipshape.serving.rest.requests import JSON


def build_probe_app(health: Health, registry: CollectorRegistry) -> FastAPI:
    """The application of a port that serves nothing else: probes speak neither mTLS nor tokens."""
    app = FastAPI(title="Shipshape health", version=version("shipshape"), docs_url=None, redoc_url=None)
    add_probes(app, health, registry)
    add_handlers(app)
    return app


def add_probes(app: FastAPI, health: Health, registry: CollectorRegistry) -> None:
    """Give `app` the paths /startedz, /livez, /readyz and /metrics."""
    probes = _Probes(health, registry)
    refusal = contract.problems(FaultKind.NOT_READY)
    for handler in (probes.started, probes.live, probes.ready):
        name = handler.__name__
        app.add_api_route(f"/{name}z", handler, methods=["GET"], operation_id=name, responses=refusal)
    app.add_api_route(
        "/metrics", probes.metrics, methods=["GET"], operation_id="metrics", response_class=PlainTextResponse
    )


class _Probes:
    def __init__(self, health: Health, registry: CollectorRegistry) -> None:
        self._health = health
        self._registry = registry

    async def started(self, request: Request) -> Response:
        """All doors listen."""
        return self._answer(request, self._health.started, "started")

    async def live(self, request: Request) -> Response:
        """The process answers, and none of its workers has died."""
        return self._answer(request, self._health.live, "live")

    async def ready(self, request: Request) -> Response:
        """Send requests here: every stage is warm, and nobody asked the service to stop or to drain."""
        return self._answer(request, self._health.ready, "ready")

    async def metrics(self) -> Response:
        """Prometheus text."""
        text = await run_in_threadpool(generate_latest, self._registry)
        return Response(text, media_type=CONTENT_TYPE_LATEST)

    def _answer(self, request: Request, holds: bool, wanted: str) -> Response:
        if holds:
            return Response(f'{{"status":"{wanted}"}}', media_type=JSON)
        identify(request.scope)
        return problem(fault_of(NotReady(f"expected a {wanted} service, got one that is {self._health.state}")))
