"""The gRPC door: shipshape.v1, the Open Inference Protocol, grpc.health.v1 and reflection on one port."""

import threading
from concurrent.futures import ThreadPoolExecutor

import grpc
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_health.v1.health import SERVICE_NAME as HEALTH_SERVICE

from shipshape.inference.open_inference_pb2_grpc import add_GRPCInferenceServiceServicer_to_server
from shipshape.serving.access import Access
from shipshape.serving.core import Core
from shipshape.serving.grpc.doorkeeper import Doorkeeper, credentials
from shipshape.serving.grpc.guard import V1, Guard
from shipshape.serving.grpc.oip_servicer import GUARDED, OipServicer
from shipshape.serving.grpc.reflection import PLACES, add_reflection
from shipshape.serving.grpc.servicer import Servicer
from shipshape.serving.grpc.streams import STREAMS, Streams
from shipshape.serving.grpc.watching import WatchedHealth
from shipshape.serving.health import Health
from shipshape.serving.timing import Timeouts
from shipshape.telemetry import Metrics
from shipshape.v1 import shipshape_pb2_grpc

SERVICES = (V1.service, GUARDED.service)
LIVE = "live"  # the name under which grpc.health.v1 tells whether the process is worth keeping
# Beside them, each contact that waits or is computed may hold a thread, so that the queue of the executor, bounded
# and refusing, is where contacts wait; streams of contacts and of reflection are bounded for the same reason.
SPARE_THREADS = 4 + PLACES  # for health and the refusals of a full queue, and for reflection streams
PING_INTERVAL_MS = (
    20_000  # that clients may ping at when idle; gRPC's own five minutes outlast what modems remember
)
# A peer that vanished without a word is asked whether it is there, and given up when it does not say so: so long
# its stream has a place. A satellite answers within seconds.
KEEPALIVE_MS, KEEPALIVE_TIMEOUT_MS = 30_000, 20_000
MESSAGE_SLACK = 4 * 2**20  # bytes over the limit that are still read, so that the refusal is ours, in one sentence


class GrpcDoor:
    """Listens from `start` to `begin_stop`; says of its health what it is told.

    Args:
        core: Answers.
        metrics: Told of every request.
        timeouts: Deadline of callers that set none.
        access: Who may come in.
        health: Whether requests should be sent here.
        shared: Other processes may listen on the same port; the system spreads connections among them.
    """

    def __init__(
        self,
        core: Core,
        metrics: Metrics,
        timeouts: Timeouts,
        access: Access,
        health: Health,
        *,
        shared: bool,
    ) -> None:
        limits = core.limits
        self._tls = access.tls
        self._health = WatchedHealth()
        self._server = grpc.server(
            ThreadPoolExecutor(core.places + SPARE_THREADS + STREAMS, thread_name_prefix="grpc"),
            interceptors=[
                Doorkeeper(access),
                *(Guard(guarded, metrics, limits, access) for guarded in (V1, GUARDED)),
            ],
            options=[
                ("grpc.so_reuseport", int(shared)),  # unasked, a second service on the same port must fail
                ("grpc.max_receive_message_length", limits.max_body_bytes + MESSAGE_SLACK),
                ("grpc.max_send_message_length", -1),
                ("grpc.http2.min_ping_interval_without_data_ms", PING_INTERVAL_MS),
                ("grpc.keepalive_permit_without_calls", 1),
                ("grpc.keepalive_time_ms", KEEPALIVE_MS),
                ("grpc.keepalive_timeout_ms", KEEPALIVE_TIMEOUT_MS),
                ("grpc.http2.ping_timeout_ms", KEEPALIVE_TIMEOUT_MS),  # of its own pings, which put ours off
                ("grpc.http2.max_pings_without_data", 0),  # any: a silent stream is what they are for
            ],
        )
        self._streams = Streams(core, metrics, timeouts, access)
        servicer = Servicer(core, metrics, timeouts, self._streams)
        shipshape_pb2_grpc.add_ShipshapeServicer_to_server(servicer, self._server)  # type: ignore[no-untyped-call]
        oip = OipServicer(core, metrics, timeouts, health)
        add_GRPCInferenceServiceServicer_to_server(oip, self._server)  # type: ignore[no-untyped-call]
        health_pb2_grpc.add_HealthServicer_to_server(self._health, self._server)
        add_reflection((*SERVICES, HEALTH_SERVICE), self._server)

    def start(self, host: str, port: int) -> int:
        """Listen; the real port.

        Raises:
            OSError: The address cannot be bound.
        """
        address = f"{_bracketed(host)}:{port}"
        try:
            if self._tls is None:
                bound: int = self._server.add_insecure_port(address)
            else:
                bound = self._server.add_secure_port(address, credentials(self._tls))
        except RuntimeError as error:
            raise OSError(f"expected to listen on {host}:{port} for gRPC, but could not") from error
        self._server.start()
        return bound

    def tell(self, *, live: bool, ready: bool) -> None:
        """What health checks hear from now on, and their watchers at once."""
        for service, serving in {LIVE: live, **dict.fromkeys(("", *SERVICES), ready)}.items():
            answer = health_pb2.HealthCheckResponse
            self._health.set(service, answer.SERVING if serving else answer.NOT_SERVING)

    def begin_stop(self, drain_s: float) -> threading.Event:
        """Accept no more; set once all under way has ended, or was broken off after `drain_s` seconds.

        Called again, it shortens what is left of `drain_s`.
        """
        self._streams.stop()
        return self._server.stop(drain_s)


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
