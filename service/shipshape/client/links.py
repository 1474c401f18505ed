"""How a connection is kept and used, by what it goes over."""

from dataclasses import dataclass
from typing import Any

import grpc


@dataclass(frozen=True, slots=True)
class Link:
    """What suits one kind of connection; seconds."""

    keepalive_s: float  # between pings of an idle connection; a service takes one every 20 s, see `grpc/server.py`
    keepalive_timeout_s: float  # without an answer to a ping, the connection is given up
    probe_s: float  # between looks at health and capacity, where there are several endpoints
    first_backoff_s: float  # after a failure; doubled with every further one
    longest_backoff_s: float
    step_m: float | None = None  # points as int16 steps of so many metres: half the bytes; None: as float32
    gzip: bool = False  # compress messages: a processor's time for bytes

    def channel_options(self) -> list[tuple[str, Any]]:
        """Of a gRPC channel."""
        return [
            ("grpc.keepalive_time_ms", round(self.keepalive_s * 1e3)),
            ("grpc.keepalive_timeout_ms", round(self.keepalive_timeout_s * 1e3)),
            ("grpc.keepalive_permit_without_calls", 1),
            ("grpc.http2.max_pings_without_data", 0),
            ("grpc.initial_reconnect_backoff_ms", round(self.first_backoff_s * 1e3)),
            ("grpc.min_reconnect_backoff_ms", round(self.keepalive_timeout_s * 1e3)),
            ("grpc.max_reconnect_backoff_ms", round(self.longest_backoff_s * 1e3)),
            ("grpc.max_receive_message_length", -1),  # restored clouds of a whole scan are over gRPC's 4 MiB
            ("grpc.enable_http_proxy", 0),  # the address is called as it is given
            ("grpc.use_local_subchannel_pool", 1),  # two clients in one process do not share a connection
        ]

    @property
    def compression(self) -> grpc.Compression:
        """Of the messages."""
        return grpc.Compression.Gzip if self.gzip else grpc.Compression.NoCompression


LAN = Link(keepalive_s=60.0, keepalive_timeout_s=5.0, probe_s=2.0, first_backoff_s=0.05, longest_backoff_s=1.0)
# Modems forget idle connections after half a minute or more; a round trip over a geostationary one is 0.6 s.
SATELLITE = Link(
    keepalive_s=25.0,
    keepalive_timeout_s=15.0,
    probe_s=15.0,
    first_backoff_s=1.0,
    longest_backoff_s=30.0,
    step_m=0.01,  # less than the noise of a LiDAR; docs/client.md has what it costs
    gzip=True,
)
