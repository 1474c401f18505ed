"""Which trace a request belongs to, for the log; and its spans, where somebody asks for them (extra `otel`).

Off by default: then no span is made, no library for it is imported, and nothing leaves the machine. The caller's
trace is taken from its `traceparent` (W3C Trace Context) either way, so that log lines of several services meet.
"""

import re
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.metadata import version
from typing import Any

from shipshape.errors import SettingsError

LAST_SPANS_S = 1.0  # that a stop waits for the collector to take what is left

_TRACEPARENT = re.compile(r"(?!ff)[0-9a-f]{2}-(?!0{32})([0-9a-f]{32})-(?!0{16})[0-9a-f]{16}-[0-9a-f]{2}(-.*)?")
_parent: ContextVar[str] = ContextVar("traceparent", default="")
trace_id: ContextVar[str] = ContextVar("trace_id", default="")  # 32 hexadecimal digits; empty: of no trace


def follow(traceparent: str) -> None:
    """What comes next in this context belongs to the caller's trace, or to none when the header says none."""
    match = _TRACEPARENT.fullmatch(traceparent)
    _parent.set(traceparent if match else "")
    trace_id.set(match[1] if match else "")


class Span:
    """A request under way, and once it has ended its stages.

    Args:
        tracer: OpenTelemetry's.
        name: Of the request, without anything that a caller chooses.
    """

    def __init__(self, tracer: Any, name: str) -> None:
        from opentelemetry import trace  # noqa: PLC0415  only where traces were asked for
        from opentelemetry.trace.propagation.tracecontext import (  # noqa: PLC0415  an extra, not always installed
            TraceContextTextMapPropagator,
        )

        parent = TraceContextTextMapPropagator().extract({"traceparent": _parent.get()})
        self._tracer = tracer
        self._begun_ns = time.time_ns()
        self._span = tracer.start_span(name, parent, trace.SpanKind.SERVER, start_time=self._begun_ns)
        self._inside = trace.set_span_in_context(self._span, parent)
        self._failed = trace.StatusCode.ERROR
        trace_id.set(f"{self._span.get_span_context().trace_id:032x}")

    def end(
        self, attributes: Mapping[str, Any], stage_ms: Mapping[str, float], computed_ns: int, *, failed: bool
    ) -> None:
        """End it, with a span for each stage.

        Args:
            attributes: Of the request.
            stage_ms: Milliseconds of each stage, in their order. Of several contacts they are sums, which work on
                several cores may make longer than the request.
            computed_ns: When the last of them had ended, nanoseconds since 1970. They are laid end to end before
                it; what lies between the request's begin and theirs is reading and waiting.
            failed: By a fault of the service.
        """
        if self._span.is_recording():
            self._span.set_attributes(attributes)
            if failed:
                self._span.set_status(self._failed)
            place = max(self._begun_ns, computed_ns - int(sum(stage_ms.values()) * 1e6))
            for name, milliseconds in stage_ms.items():
                stage = self._tracer.start_span(f"stage {name}", self._inside, start_time=place)
                place += int(milliseconds * 1e6)
                stage.end(place)
        self._span.end()


class _Tracing:
    """Where spans are made; `tracer` is OpenTelemetry's, None while nobody asked for spans."""

    def __init__(self) -> None:
        self.tracer: Any = None


_tracing = _Tracing()


def begin(name: str) -> Span | None:
    """The span of a request that begins now in this context; None, at no cost, unless `traces` is open."""
    return None if _tracing.tracer is None else Span(_tracing.tracer, name)


@contextmanager
def traces(url: str | None, share: float) -> Iterator[None]:
    """While the block runs, spans are sent to a collector, and what is left of them when it ends.

    Args:
        url: OTLP over HTTP, such as http://127.0.0.1:4318/v1/traces; None makes and sends none.
        share: Of the requests whose caller has not decided whether they are traced.

    Raises:
        SettingsError: The extra `otel` is not installed.
    """
    if url is None:
        yield
        return
    provider = _provider(url, share)
    _tracing.tracer = provider.get_tracer("shipshape")
    try:
        yield
    finally:
        _tracing.tracer = None
        # By itself it waits half a minute for a collector that does not answer; by then somebody sends SIGKILL.
        closing = threading.Thread(target=provider.shutdown, name="last-spans", daemon=True)
        closing.start()
        closing.join(LAST_SPANS_S)


def _provider(url: str, share: float) -> Any:
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import (  # noqa: PLC0415  takes half a second
            OTLPSpanExporter,
        )
        from opentelemetry.sdk.resources import Resource  # noqa: PLC0415  an extra, not always installed
        from opentelemetry.sdk.trace import TracerProvider  # noqa: PLC0415  an extra, not always installed
        from opentelemetry.sdk.trace.export import BatchSpanProcessor  # noqa: PLC0415  an extra, not always installed
        from opentelemetry.sdk.trace.sampling import ParentBasedTraceIdRatio  # noqa: PLC0415  an extra, not always installed
    except ModuleNotFoundError as error:
        raise SettingsError(
            f"expected the libraries of the extra shipshape[otel] beside SHIPSHAPE_TRACES_URL, got no {error.name}"
        ) from error
    resource = Resource.create({"service.name": "shipshape", "service.version": version("shipshape")})
    provider = TracerProvider(ParentBasedTraceIdRatio(share), resource, shutdown_on_exit=False)
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter(url)))
    return provider
