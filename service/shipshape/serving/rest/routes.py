"""The handlers of the REST door: translate, delegate to the core, translate back."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import TypeVar

from fastapi import HTTPException, Response
from starlette.concurrency import run_in_threadpool

from shipshape.executor import Lane, Ticket
from shipshape.serving.clients import Clients, Share
from shipshape.serving.core import Core, Scan, conclude, outcome_of
from shipshape.serving.encoding import Wishes, check_contacts
from shipshape.serving.faults import FaultKind, fault_of
from shipshape.serving.load_report import HTTP_HEADER, as_text
from shipshape.serving.model import Order, Reply
from shipshape.serving.rest import answers
from shipshape.serving.rest.bodies import Bodies
from shipshape.serving.rest.headers import TIMEOUT_NAME, check_encoding, media_type, timeout_s
from shipshape.serving.rest.incoming import FromRequest, Incoming
from shipshape.serving.rest.json_process import Parse
from shipshape.serving.rest.problems import ID_NAME, identify, problem, refusal
from shipshape.serving.rest.requests import (
    CONTACT_FORMS,
    JSON,
    PACKED,
    SCAN_FORMS,
    announced_contacts,
    parse_capacity,
)
from shipshape.serving.rest.waiting import until_settled
from shipshape.serving.timing import Timeouts, server_timing
from shipshape.telemetry import SCAN, SINGLE, Metrics, Outcome

Handler = Callable[[Incoming, Outcome, Share], Awaitable[Response]]
T = TypeVar("T")
SMALL_BYTES = 64 * 2**10  # of a body: JSON of this size is parsed in under a millisecond
SMALL_SCAN = 32  # contacts: written in under a millisecond


class Routes:
    """One method a path. Large bodies are parsed and written off the event loop.

    Args:
        core: Answers.
        metrics: Told of every request.
        timeouts: Deadline of requests that set none.
        clients: Hold each to its share.
        bodies: Bounds all bodies that are being read, and parses large JSON.
    """

    def __init__(
        self,
        core: Core,
        metrics: Metrics,
        timeouts: Timeouts,
        clients: Clients,
        bodies: Bodies,
    ) -> None:
        self._core = core
        self._metrics = metrics
        self._timeouts = timeouts
        self._clients = clients
        self._bodies = bodies

    async def recognise(self, incoming: FromRequest) -> Response:
        """One contact: JSON, or its points in a binary form with everything else in the query."""
        return await self._guarded(incoming, SINGLE, self._recognise)

    async def scan(self, incoming: FromRequest) -> Response:
        """Many contacts of one scan, admitted together or not at all; a bad one does not spoil the others."""
        return await self._guarded(incoming, SCAN, self._scan)

    async def model(self, incoming: FromRequest) -> Response:
        """What this service runs and what it accepts."""
        return await self._guarded(incoming, "model_info", self._model)

    async def capacity(self, incoming: FromRequest) -> Response:
        """What the service would promise now, and how its latency budget is doing."""
        return await self._guarded(incoming, "capacity", self._capacity)

    async def _guarded(self, incoming: Incoming, method: str, handle: Handler) -> Response:
        """What every method passes: request id, metrics, and the table of errors."""
        given = identify(incoming.scope)
        with self._metrics.request("rest", method, incoming.waited()) as outcome:
            try:
                with self._clients.share(incoming.client) as share:
                    response = await handle(incoming, outcome, share)
            except HTTPException as error:
                outcome.kind = FaultKind.INVALID_INPUT
                return refusal(error, error.detail)
            except Exception as error:
                fault = fault_of(error)
                outcome.kind = fault.kind
                return problem(fault)
        response.raw_headers.append((ID_NAME, given.encode()))
        return response

    async def _recognise(self, incoming: Incoming, outcome: Outcome, share: Share) -> Response:
        model, seconds = self._core.model(), self._seconds(incoming)
        share.take(1)
        check_encoding(incoming.header(b"content-encoding"))
        kind = media_type(incoming.header(b"content-type"), *CONTACT_FORMS)
        form, deadline = CONTACT_FORMS[kind], self._core.deadline_in(seconds)
        self._core.check(form.lane(incoming.query), deadline)
        async with self._bodies.read(incoming, seconds) as body:
            parse = await self._parser(kind, form.parse, body, incoming.query, deadline)

            def submit() -> tuple[Ticket[Reply[bytes]], Wishes]:
                """Parse and queue; in a thread of its own where the body is large."""
                contact, wishes = parse()
                return self._core.submit(model, Order(contact, wishes, answers.encode), deadline), wishes

            ticket, wishes = await _run(submit, small=len(body) <= SMALL_BYTES)
        outcome.urgent = wishes.lane is not Lane.BATCH
        await until_settled([ticket], incoming)
        reply = ticket.result()
        outcome.kind = outcome_of(reply)
        outcome.computed(reply.stage_ms)
        return self._timed(reply.content, reply.stage_ms)

    async def _scan(self, incoming: Incoming, outcome: Outcome, share: Share) -> Response:
        model, seconds = self._core.model(), self._seconds(incoming)
        check_encoding(incoming.header(b"content-encoding"))
        kind = media_type(incoming.header(b"content-type"), *SCAN_FORMS)
        form, deadline = SCAN_FORMS[kind], self._core.deadline_in(seconds)
        if kind == PACKED:
            outcome.contacts = announced_contacts(incoming.query)
        self._core.check(form.lane(incoming.query), deadline)
        async with self._bodies.read(incoming, seconds) as body:
            parse = await self._parser(kind, form.parse, body, incoming.query, deadline)

            def submit() -> tuple[Sequence[str], Scan[bytes], Wishes]:
                """Parse and queue; in a thread of its own where the body is large."""
                parsed = parse()
                outcome.contacts = parsed.count
                check_contacts(parsed.count, self._core.limits)
                share.take(parsed.count)
                scan = self._core.submit_scan(model, parsed.contacts, parsed.wishes, answers.encode, deadline)
                return parsed.contact_ids, scan, parsed.wishes

            ids, scan, wishes = await _run(submit, small=len(body) <= SMALL_BYTES)
        outcome.urgent = wishes.lane is not Lane.BATCH
        await until_settled(scan.tickets, incoming)
        outcomes, stage_ms = conclude(scan, "rest", self._metrics)
        outcome.computed(stage_ms)
        return self._timed(answers.joined(ids, outcomes), stage_ms)

    async def _parser(
        self, kind: str, parse: Parse[T], body: bytes, query: str, deadline: float
    ) -> Callable[[], T]:
        json_bytes, left = len(body) if kind == JSON else 0, self._core.seconds_until(deadline)
        return await self._bodies.parser(parse, body, query, left, json_bytes=json_bytes)

    async def _model(self, _incoming: Incoming, _: Outcome, _share: Share) -> Response:
        value = answers.from_model(self._core.model(), self._core.limits, self._timeouts)
        return _json(answers.to_bytes(value))

    async def _capacity(self, incoming: Incoming, _: Outcome, _share: Share) -> Response:
        asked = parse_capacity(incoming.query)
        capacity = self._core.capacity(asked.points, asked.lane)
        return _json(answers.to_bytes(answers.from_capacity(capacity, self._metrics.budget.report())))

    def _timed(self, content: bytes, stage_ms: Mapping[str, float]) -> Response:
        headers = {"Server-Timing": server_timing(stage_ms), HTTP_HEADER: as_text(self._core.load())}
        return Response(content, headers=headers, media_type=JSON)

    def _seconds(self, incoming: Incoming) -> float:
        """What is left until the deadline, which counts from the request's first byte."""
        return timeout_s(incoming.header(TIMEOUT_NAME), self._timeouts.default_ms) - incoming.waited()


async def _run(work: Callable[[], T], *, small: bool) -> T:
    """Do the work here if it takes less than handing it to a thread, else where it holds nobody up."""
    return work() if small else await run_in_threadpool(work)


def _json(content: bytes) -> Response:
    return Response(content, media_type=JSON)
