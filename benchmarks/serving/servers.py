"""Every server of the benchmark: how it is started on some cores, and what is sent to it."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.serving import wires
from benchmarks.serving.wires import Clusters, Wire

ENVIRONMENTS = Path("runs/serving/environments")
PEERS = "benchmarks.serving.peers"


@dataclass(frozen=True, slots=True)
class Server:
    """One row of the table.

    Attributes:
        name: As in the keys of the results.
        package: The peer's distribution, whose version is reported.
        command: Of its start; "{python}" and "{bin}" are its environment's, "{port}" and "{cores}" what it gets.
        write: Makes what is sent of clusters.
        environment: Name of the peer's pinned requirements; empty: the environment that runs the benchmark.
        note: What is worth knowing when its numbers are compared.
    """

    name: str
    package: str
    command: tuple[str, ...]
    write: Callable[[Clusters], Wire]
    environment: str = ""
    note: str = ""

    @property
    def ours(self) -> bool:
        """Whether it is Shipshape."""
        return self.package == "shipshape"

    @property
    def python(self) -> Path:
        """The interpreter of its environment."""
        return ENVIRONMENTS / self.environment / "bin/python" if self.environment else Path(sys.executable)


def _ours(name: str, write: Callable[[Clusters], Wire], note: str) -> Server:
    ports = ("--rest-port", "{port}", "--grpc-port", "{grpc_port}")
    return Server(name, "shipshape", ("{python}", "-m", "shipshape", "serve", *ports), write, note=note)


def _fastapi(name: str, write: Callable[[Clusters], Wire], note: str) -> Server:
    options = ("--port", "{port}", "--workers", "{cores}", "--log-level", "warning", "--no-access-log")
    return Server(
        name, "fastapi", ("{python}", "-m", "uvicorn", f"{PEERS}.fastapi:app", *options), write, note=note
    )


def _peer(name: str, package: str, write: Callable[[Clusters], Wire], note: str, *options: str) -> Server:
    return Server(name, package, ("{python}", "-m", f"{PEERS}.{name}", *options), write, name, note)


SERVERS = (
    _ours(
        "rest_binary",
        wires.binary("/v1/recognise?lowest_rung=full"),
        "full answer of the contract, deadlines, admission, metrics",
    ),
    _ours("grpc_unary", wires.unary, "the same over gRPC"),
    _ours("grpc_stream", wires.stream, "the same, one contact a message"),
    _ours("grpc_scan8", wires.scan(8), f"8 contacts a call, {wires.SCAN} connections"),
    _ours("grpc_scan32", wires.scan(32), f"32 contacts a call, {wires.SCAN} connections"),
    _peer(
        "robyn",
        "robyn",
        wires.binary("/recognise"),
        "bytes; no checks, no limits",
        *("--processes", "{cores}", "--workers", "1", "--log-level", "WARN"),
    ),
    _peer(
        "mosec",
        "mosec",
        wires.binary("/inference"),
        "bytes; bounded first queue",
        "--port",
        "{port}",
        "--timeout",
        "5000",
    ),
    _fastapi(
        "fastapi_binary", wires.binary("/binary"), "bytes; computes on the event loop, which answers nothing else"
    ),
    _fastapi("fastapi_json", wires.as_json("/json"), "JSON"),
    _peer("litserve", "litserve", wires.as_json("/predict"), "JSON: it parses every body but forms"),
    Server(
        "bentoml",
        "bentoml",
        ("{bin}/bentoml", "serve", f"{PEERS}.bentoml:Recogniser", "--host", "127.0.0.1", "--port", "{port}"),
        wires.binary("/recognise"),
        "bentoml",
        "bytes",
    ),
    _peer("mlserver", "mlserver", wires.v2_json("/v2/models/recognise/infer"), "Open Inference Protocol, JSON"),
    _peer(
        "pytriton",
        "nvidia-pytriton",
        wires.v2_binary("/v2/models/recognise/infer"),
        "Open Inference Protocol, binary tensor; numpy 1",
    ),
)
