"""The handlers of the REST door: translate, delegate to the core, translate back."""

from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

from fastapi import HTTPException, Request, Response
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
from starlette.concurrency import run_in_threadpool

from shipshape.errors import NotReady
from shipshape.executor import Ticket
from shipshape.serving.core import Answer, Core, Scan
from shipshape.serving.encoding import Wishes
from shipshape.serving.faults import Fault, FaultKind, fault_of
from shipshape.serving.rest import answers
from shipshape.serving.rest.problems import ID_HEADER, problem
from shipshape.serving.rest.requests import (
    JSON,
    PACKED,
    media_type,
    parse_json,
    parse_packed,
    parse_scan,
    read_body,
    timeout_s,
)
from shipshape.serving.rest.waiting import until_settled
from shipshape.serving.timing import Timeouts, server_timing, summed
from shipshape.telemetry import OK, SINGLE, Metrics, new_request_id, request_id

Handler = Callable[[Request], Awaitable[Response]]
T = TypeVar("T")
SMALL_BYTES = 64 * 2**10  # of a body: JSON of this size is parsed in under a millisecond
SMALL_SCAN = 32  # contacts: written in under a millisecond


class Routes:
    """One method a path. Large bodies are parsed and written off the event loop."""

    def __init__(self, core: Core, metrics: Metrics, timeouts: Timeouts) -> None:
        self._core = core
        self._metrics = metrics
        self._timeouts = timeouts

    async def recognise(self, request: Request) -> Response:
        """One contact: JSON, or packed points with everything else in the query."""
        return await self._guarded(request, SINGLE, self._recognise)

    async def scan(self, request: Request) -> Response:
        """Many contacts of one scan, admitted together or not at all; a bad one does not spoil the others."""
        return await self._guarded(request, "recognise_scan", self._scan)

    async def model(self, request: Request) -> Response:
        """What this service runs and what it accepts."""
        return await self._guarded(request, "model_info", self._model)

    async def live(self) -> Response:
        """The process answers."""
        return _json(b'{"status":"live"}')

    async def ready(self) -> Response:
        """Requests are taken: every stage is warm and nobody asked the service to stop."""
        if self._core.ready:
            return _json(b'{"status":"ready"}')
        return problem(fault_of(NotReady("expected a ready service, got one that is starting or stopping")))

    async def metrics(self) -> Response:
        """Prometheus text."""
        text = await run_in_threadpool(generate_latest, self._metrics.registry)
        return Response(text, media_type=CONTENT_TYPE_LATEST)

    async def _guarded(self, request: Request, method: str, handle: Handler) -> Response:
        """What every method passes: request id, metrics, and the table of errors."""
        new_request_id(request.headers.get(ID_HEADER, ""))
        with self._metrics.request("rest", method) as outcome:
            try:
                response = await handle(request)
            except HTTPException:  # its answer is the handlers' matter
                outcome.kind = FaultKind.INVALID_INPUT
                raise
            except Exception as error:
                fault = fault_of(error)
                outcome.kind = fault.kind
                return problem(fault)
        response.headers[ID_HEADER] = request_id.get()
        return response

    async def _recognise(self, request: Request) -> Response:
        deadline, body = self._deadline(request), await self._body(request)
        parse = parse_packed if media_type(request, JSON, PACKED) == PACKED else parse_json

        def submit() -> tuple[Ticket[Answer], Wishes]:
            contact, wishes = parse(body, request.query_params, self._core.limits)
            return self._core.submit(contact, wishes, deadline), wishes

        ticket, wishes = await _run(submit, small=len(body) <= SMALL_BYTES)
        await until_settled([ticket], request)
        return await _run(lambda: _single(ticket, wishes), small=not _bulky(wishes))

    async def _scan(self, request: Request) -> Response:
        deadline, body = self._deadline(request), await self._body(request)
        media_type(request, JSON)

        def submit() -> tuple[list[str], Scan, Wishes]:
            ids, contacts, wishes = parse_scan(body, request.query_params, self._core.limits)
            return ids, self._core.submit_scan(contacts, wishes, deadline), wishes

        ids, scan, wishes = await _run(submit, small=len(body) <= SMALL_BYTES)
        await until_settled(scan.tickets, request)
        small = not _bulky(wishes) and len(ids) <= SMALL_SCAN
        return await _run(lambda: self._many(ids, scan, wishes), small=small)

    async def _model(self, request: Request) -> Response:
        value = answers.from_model(self._core.model(), self._core.limits, self._timeouts)
        return _json(answers.to_bytes(value))

    def _many(self, ids: list[str], scan: Scan, wishes: Wishes) -> Response:
        outcomes = [fault_of(end) if isinstance(end, Exception) else end for end in scan.outcomes()]
        self._metrics.count_contacts("rest", (end.kind if isinstance(end, Fault) else OK for end in outcomes))
        timing = server_timing(summed(end.recognition for end in outcomes if not isinstance(end, Fault)))
        return _json(answers.to_bytes(answers.from_outcomes(ids, outcomes, wishes)), timing)

    def _deadline(self, request: Request) -> float:
        return self._core.deadline_in(timeout_s(request, self._timeouts.default_ms))

    async def _body(self, request: Request) -> bytes:
        return await read_body(request, self._core.limits)


async def _run(work: Callable[[], T], *, small: bool) -> T:
    """Do the work here if it takes less than handing it to a thread, else where it holds nobody up."""
    return work() if small else await run_in_threadpool(work)


def _bulky(wishes: Wishes) -> bool:
    return wishes.restored or wishes.images or wishes.png


def _single(ticket: Ticket[Answer], wishes: Wishes) -> Response:
    answer = ticket.result()
    timing = server_timing(answer.recognition.stage_ms)
    return _json(answers.to_bytes(answers.from_answer(answer, wishes)), timing)


def _json(content: bytes, timing: str | None = None) -> Response:
    headers: dict[str, Any] = {} if timing is None else {"Server-Timing": timing}
    return Response(content, headers=headers, media_type=JSON)
