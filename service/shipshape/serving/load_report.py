"""How loaded this service is, beside every answer, for balancers that read Open Request Cost Aggregation (ORCA).

`application_utilization` is contacts that wait or are computed, a worker: over 1, there is a queue.
"""

import struct

HTTP_HEADER = "endpoint-load-metrics"
GRPC_TRAILER = "endpoint-load-metrics-bin"
PLAIN_TRAILER = "shipshape-load"  # the number alone: gRPC keeps the other from callers, for balancers of its own
_TAG = bytes([9 << 3 | 1])  # of xds.data.orca.v3.OrcaLoadReport.application_utilization: field 9, a double


def as_text(load: float) -> str:
    """The text form, for HTTP."""
    return f"TEXT application_utilization={load:.3f}"


def as_message(load: float) -> bytes:
    """The same as a protobuf message, for gRPC; without the schema's package, which clients bring themselves."""
    return _TAG + struct.pack("<d", load)
