"""The Open Inference Protocol's paths on the REST door: translate, delegate to the core, translate back."""

from collections.abc import Awaitable, Callable, Mapping
from http import HTTPMethod
from typing import Any

import orjson
from fastapi import HTTPException, Request, Response
from starlette.concurrency import run_in_threadpool
from starlette.routing import Route

from shipshape.errors import NotReady
from shipshape.serving.clients import Clients
from shipshape.serving.core import Core
from shipshape.serving.faults import Fault, FaultKind, fault_of
from shipshape.serving.health import Health
from shipshape.serving.load_report import HTTP_HEADER, as_text
from shipshape.serving.model import Model
from shipshape.serving.oip import models
from shipshape.serving.oip.inference import Inference, submit
from shipshape.serving.rest.bodies import Bodies
from shipshape.serving.rest.headers import TIMEOUT_HEADER, check_encoding, media_type, timeout_s
from shipshape.serving.rest.incoming import Incoming
from shipshape.serving.rest.oip_bodies import JSON_BYTES_HEADER, Asked, json_end, parse_infer, write_answer
from shipshape.serving.rest.problems import ID_HEADER, STATUS, identify, retry_headers
from shipshape.serving.rest.requests import JSON, PACKED
from shipshape.serving.rest.routes import SMALL_BYTES, SMALL_SCAN
from shipshape.serving.rest.waiting import until_settled
from shipshape.serving.timing import Timeouts, server_timing
from shipshape.telemetry import INFER, Metrics, Outcome, request_id

DOOR = "oip_rest"
Handler = Callable[[Request, Outcome], Awaitable[Response]]


class OipRoutes:
    """One method a path of the protocol.

    Args:
        core: Answers.
        metrics: Told of every request.
        timeouts: Deadline of callers that set none.
        clients: Hold each to its share.
        bodies: Bounds all bodies that are being read, those of the other paths too.
        health: Whether requests should be sent here.
    """

    def __init__(
        self,
        core: Core,
        metrics: Metrics,
        timeouts: Timeouts,
        clients: Clients,
        bodies: Bodies,
        health: Health,
    ) -> None:
        self._core = core
        self._metrics = metrics
        self._timeouts = timeouts
        self._clients = clients
        self._bodies = bodies
        self._health = health

    def routes(self) -> list[Route]:
        """The paths; they are the protocol's, so /openapi.json does not list them."""
        model = "/v2/models/{name}"
        found = [
            self._route("/v2", "GET", "server_metadata", self._server_metadata),
            self._route("/v2/health/live", "GET", "server_live", self._server_live),
            self._route("/v2/health/ready", "GET", "server_ready", self._server_ready),
        ]
        for path in (model, model + "/versions/{version}"):
            found.append(self._route(path, "GET", "model_metadata", self._model_metadata))
            found.append(self._route(path + "/ready", "GET", "model_ready", self._model_ready))
            found.append(self._route(path + "/infer", "POST", INFER, self._infer))
        return [*found, self._route("/v2/{path:path}", "", "unknown", self._unknown)]

    def _route(self, path: str, verb: str, method: str, handle: Handler) -> Route:
        async def guarded(request: Request) -> Response:
            """What every path passes: request id, metrics, and the table of errors."""
            given = identify(request.scope)
            with self._metrics.request(DOOR, method) as outcome:
                try:
                    _check_verb(request, verb)
                    response = await handle(request, outcome)
                except Exception as error:
                    outcome.kind, response = _refused(error)
            response.headers[ID_HEADER] = given
            return response

        # All verbs: the framework's own refusal of one would not have the protocol's form.
        return Route(path, guarded, methods=list(HTTPMethod))

    async def _server_metadata(self, _request: Request, _: Outcome) -> Response:
        return _json(models.server_metadata())

    async def _server_live(self, _request: Request, _: Outcome) -> Response:
        return _json({"live": True})

    async def _server_ready(self, _request: Request, _: Outcome) -> Response:
        self._check_ready()
        return _json({"ready": True, "live": True})  # the specification says live, its clients read ready

    async def _model_ready(self, request: Request, _: Outcome) -> Response:
        self._model(request)
        self._check_ready()
        return _json({"name": models.NAME, "ready": True})

    async def _model_metadata(self, request: Request, _: Outcome) -> Response:
        return _json(models.model_metadata(self._model(request), self._core.limits))

    async def _infer(self, request: Request, outcome: Outcome) -> Response:
        model, incoming = self._model(request), Incoming(request.scope, request.receive)
        seconds = timeout_s(request.headers.get(TIMEOUT_HEADER), self._timeouts.default_ms) - incoming.waited()
        _check_form(request)
        deadline = self._core.deadline_in(seconds)
        with self._clients.share(incoming.client) as share:
            async with self._bodies.read(incoming, seconds) as body:
                end = json_end(body, request.headers.get(JSON_BYTES_HEADER))
                left = self._core.seconds_until(deadline)
                parse = await self._bodies.parser(parse_infer, body, str(end), left, json_bytes=end)

                def begin() -> tuple[Asked, Inference]:
                    """Parse and queue; in a thread of its own where the body is large."""
                    asked = parse()
                    return asked, submit(self._core, model, asked.request, deadline, outcome, share)

                small = len(body) <= SMALL_BYTES
                asked, inference = begin() if small else await run_in_threadpool(begin)
            await until_settled(inference.tickets, incoming)
        if inference.bulky or len(inference.contact_ids) > SMALL_SCAN:
            return await run_in_threadpool(self._answer, model, asked, inference, outcome)
        return self._answer(model, asked, inference, outcome)

    async def _unknown(self, request: Request, _: Outcome) -> Response:
        raise HTTPException(404, f"expected a path of the Open Inference Protocol, got {request.url.path!r:.80}")

    def _answer(self, model: Model, asked: Asked, inference: Inference, outcome: Outcome) -> Response:
        tensors, stage_ms = inference.conclude(DOOR, self._metrics, outcome)
        outcome.computed(stage_ms)
        fields = {"model_name": models.NAME, "model_version": models.version_of(model)}
        content, json_bytes = write_answer(fields, tensors, asked)
        headers = {"Server-Timing": server_timing(stage_ms), HTTP_HEADER: as_text(self._core.load())}
        if json_bytes is None:
            return Response(content, headers=headers, media_type=JSON)
        return Response(content, headers={**headers, JSON_BYTES_HEADER: str(json_bytes)}, media_type=PACKED)

    def _check_ready(self) -> None:
        if not self._health.ready:
            raise NotReady(f"expected a ready service, got one that is {self._health.state}")

    def _model(self, request: Request) -> Model:
        return models.find_model(self._core, request.path_params["name"], request.path_params.get("version", ""))


def _check_verb(request: Request, verb: str) -> None:
    if verb and request.method != verb:
        raise HTTPException(405, f"expected {verb} on {request.url.path}, got {request.method}", {"Allow": verb})


def _check_form(request: Request) -> None:
    if "content-type" in request.headers:  # Triton's client names none
        media_type(request.headers["content-type"], JSON, PACKED)
    check_encoding(request.headers.get("content-encoding"))


def _refused(error: Exception) -> tuple[FaultKind, Response]:
    """The protocol's error object; beside its sentence what a problem document of the other paths says."""
    if isinstance(error, HTTPException):
        fault, status = Fault(FaultKind.INVALID_INPUT, error.detail), error.status_code
        headers: Mapping[str, str] = error.headers or {}
    else:
        fault = fault_of(error)
        headers = retry_headers(fault)
        status = 404 if isinstance(error, models.UnknownModel) else STATUS[fault.kind]
    body = {
        "error": fault.message,
        "type": f"urn:shipshape:problem:{fault.kind}",
        "title": fault.kind.replace("_", " ").capitalize(),
        "status": status,
        "kind": fault.kind,
        "request_id": request_id.get(),
    }
    return fault.kind, Response(orjson.dumps(body), status, headers, media_type=JSON)


def _json(value: Mapping[str, Any]) -> Response:
    return Response(orjson.dumps(value), media_type=JSON)
