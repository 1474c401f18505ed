"""What goes over the wire to each server, written once and beforehand, and how its answers are read."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shipshape.v1 import shipshape_pb2 as pb

SINGLE, SCAN = 16, 4  # connections of requests with one contact, and with many
CHANNELS = 64  # of gRPC in an open loop
GRPC = 1  # port of our gRPC door beyond that of REST
SERVICE = "/shipshape.v1.Shipshape"
FULL = pb.Options(lowest_rung=pb.RUNG_FULL)  # a cheaper answer would not be the same work


@dataclass(frozen=True, slots=True)
class Wire:
    """Requests as they are sent.

    Attributes:
        kind: "http" for whole HTTP/1.1 requests; "unary" and "stream" for messages of a gRPC call.
        requests: Sent in turns.
        read: The vessels that one answer names, in the order of the request's contacts.
        method: Of a gRPC call.
        contacts: Of each request.
        connections: In a closed loop.
        most: Connections of an open loop: it opens more as it needs them, and beyond these requests wait.
        port: Beyond the server's first.
    """

    kind: str
    requests: tuple[bytes, ...]
    read: Callable[[bytes], list[str]]
    method: str = ""
    contacts: int = 1
    connections: int = SINGLE
    most: int = 1024
    port: int = 0


Clusters = Sequence[np.ndarray]


def binary(path: str, headers: str = "") -> Callable[[Clusters], Wire]:
    """Packed points in the body of a POST."""
    head = f"Content-Type: application/octet-stream\r\n{headers}"
    return lambda clusters: Wire("http", _posts(path, [_packed(points) for points in clusters], head), plain)


def as_json(path: str) -> Callable[[Clusters], Wire]:
    """{"points": [[x, y, z], ...]}, to the millimetre."""
    return lambda clusters: Wire("http", _posts(path, [_json({"points": _rows(c)}) for c in clusters]), plain)


def v2_json(path: str) -> Callable[[Clusters], Wire]:
    """Open Inference Protocol in JSON."""

    def write(clusters: Clusters) -> Wire:
        bodies = [
            _json({"inputs": [{**_tensor(points), "data": [v for row in _rows(points) for v in row]}]})
            for points in clusters
        ]
        return Wire("http", _posts(path, bodies), v2)

    return write


def v2_binary(path: str) -> Callable[[Clusters], Wire]:
    """Open Inference Protocol with Triton's extension for binary tensors."""

    def write(clusters: Clusters) -> Wire:
        requests: list[bytes] = []
        for points in clusters:
            data = _packed(points)
            header = _json({"inputs": [{**_tensor(points), "parameters": {"binary_data_size": len(data)}}]})
            length = f"Inference-Header-Content-Length: {len(header)}\r\n"
            requests += _posts(path, [header + data], f"Content-Type: application/octet-stream\r\n{length}")
        return Wire("http", tuple(requests), v2)

    return write


def unary(clusters: Clusters) -> Wire:
    """Our gRPC call with one contact."""
    requests = [pb.RecogniseRequest(contact=contact, options=FULL) for contact in _messages(clusters)]
    return Wire("unary", _written(requests), vessel_of, f"{SERVICE}/Recognise", most=CHANNELS, port=GRPC)


def stream(clusters: Clusters) -> Wire:
    """Our gRPC stream, one contact a message, one message at a time."""
    requests = [pb.RecogniseStreamRequest(contacts=[contact], options=FULL) for contact in _messages(clusters)]
    return Wire(
        "stream", _written(requests), vessels_of_message, f"{SERVICE}/RecogniseStream", most=SINGLE, port=GRPC
    )


def scan(size: int) -> Callable[[Clusters], Wire]:
    """Our gRPC call with a scan of `size` contacts."""

    def write(clusters: Clusters) -> Wire:
        contacts = _messages([clusters[index % len(clusters)] for index in range(size)])
        request = pb.RecogniseScanRequest(contacts=contacts, options=FULL)
        return Wire(
            "unary", _written([request]), vessels_of_scan, f"{SERVICE}/RecogniseScan", size, SCAN, CHANNELS, GRPC
        )

    return write


def plain(body: bytes) -> list[str]:
    """The vessel of a JSON answer."""
    return [json.loads(body)["vessel"]]


def v2(body: bytes) -> list[str]:
    """The vessel of a JSON answer inside of an Open Inference Protocol answer."""
    return [json.loads(json.loads(body)["outputs"][0]["data"][0])["vessel"]]


def vessel_of(body: bytes) -> list[str]:
    """The vessel of our gRPC answer."""
    return [pb.RecogniseResponse.FromString(body).recognition.vessel]


def vessels_of_scan(body: bytes) -> list[str]:
    """The vessels of our gRPC answer to a scan."""
    return [result.recognition.vessel for result in pb.RecogniseScanResponse.FromString(body).results]


def vessels_of_message(body: bytes) -> list[str]:
    """The vessels of one answer of our gRPC stream."""
    return [result.recognition.vessel for result in pb.RecogniseStreamResponse.FromString(body).results]


def _posts(path: str, bodies: Sequence[bytes], headers: str = "Content-Type: application/json\r\n") -> tuple:
    return tuple(
        f"POST {path} HTTP/1.1\r\nHost: localhost\r\n{headers}Content-Length: {len(body)}\r\n\r\n".encode() + body
        for body in bodies
    )


def _messages(clusters: Clusters) -> list[pb.Contact]:
    return [pb.Contact(points=_packed(points)) for points in clusters]


def _written(requests: Sequence) -> tuple[bytes, ...]:
    return tuple(request.SerializeToString() for request in requests)


def _tensor(points: np.ndarray) -> dict:
    return {"name": "points", "shape": list(points.shape), "datatype": "FP32"}


def _packed(points: np.ndarray) -> bytes:
    return points.astype("<f4").tobytes()


def _rows(points: np.ndarray) -> list[list[float]]:
    return [[round(float(value), 3) for value in row] for row in points]


def _json(value: dict) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode()
