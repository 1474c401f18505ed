"""A real `shipshape serve`, and the one question after each fault: is everything as it was before?"""

import hashlib
import json
import os
import re
import threading
import time
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import grpc
import httpx
import numpy as np
import psutil
import pytest
from grpc_health.v1 import health_pb2
from grpc_health.v1.health_pb2_grpc import HealthStub

from oip.wire import by_grpc_raw, by_json
from serving.fakes import cluster, request, rows
from serving.processes import SERVE_FAKES, start
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

PATIENCE = 60.0
LOOK_S = 0.02  # between two looks whether something has come true
TOKEN = "the operator's"
PACKED = {"content-type": "application/octet-stream"}
POINTS, HEIGHT_M = cluster(), 3.0
WORKERS, MAX_CONTACTS, QUEUE_LIMIT = 2, 64, 128
PORTS = re.compile(r"REST http://\S+?:(\d+), gRPC \S+?:(\d+), health port (\d+), admin port (\d+)")
BURST, CALM = 200, 2  # calls at a time; bursts after which no more threads are started
THREADS = 24  # that pools of libraries may start late
ROOM_MB = 100.0  # that allocators may keep
# Contact ids that mean something, beside those of the fake pipeline. What they do is seen from every process.
FAULTY = (
    """
import os, threading
from pathlib import Path
import numpy as np
from serving.fakes import FakePipeline
as_usual, pause = FakePipeline._prior, threading.Event().wait  # time.sleep fails where the clock is faked
journal = os.open(os.environ["JOURNAL"], os.O_WRONLY | os.O_CREAT | os.O_APPEND)
as_made = FakePipeline.__init__
def made(self):
    as_made(self)
    object.__setattr__(self.stages[-1], "run", lambda work: noted(work, self.stages[-1].name))
def noted(work, stage):
    os.write(journal, f"{work.contact.contact_id} {stage}\\n".encode())
def prior(self, work):
    noted(work, self.stages[0].name)
    if work.contact.contact_id == "wedge":
        for _ in range(1000):
            if Path(os.environ["RELEASE"]).exists():
                return
            pause(0.01)
    if work.contact.contact_id == "memory":
        np.zeros(1 << 50)
    if work.contact.contact_id == "slow":
        pause(0.02)
    as_usual(self, work)
FakePipeline.__init__, FakePipeline._prior = made, prior
"""
    + SERVE_FAKES
)


@dataclass(frozen=True)
class Counts:
    """What became of all contacts, as the admin door tells it."""

    offered: int
    refused: int
    completed: int
    degraded: int
    expired: int
    cancelled: int
    failed: int
    pending: int

    @property
    def settled(self):
        return self.completed + self.degraded + self.expired + self.cancelled + self.failed

    def since(self, before):
        return Counts(**{name: value - getattr(before, name) for name, value in vars(self).items()})


@dataclass(frozen=True)
class Footprint:
    """What the process and all its children hold."""

    threads: int
    descriptors: int
    rss_mb: float


@dataclass
class Live:
    """A service in a process of its own, with clients of all its doors, and its log as it is written."""

    process: object
    rest: httpx.Client
    admin: httpx.Client
    health: httpx.Client
    channel: grpc.Channel
    grpc_port: int
    release: Path  # a file: it sets stages free that are stuck, as long as it is there
    log: list = field(default_factory=list)

    @property
    def stub(self):
        return ShipshapeStub(self.channel)

    @property
    def rest_address(self):
        return self.rest.base_url.host, self.rest.base_url.port

    @property
    def grpc_address(self):
        return "127.0.0.1", self.grpc_port

    def counts(self):
        return Counts(**self.admin.get("/admin/status").json()["contacts"])

    def metric(self, name):
        """The sum over all labels."""
        text = self.health.get("/metrics").text
        return sum(float(value) for value in re.findall(rf"^{name}(?:\{{.*\}})? (\S+)$", text, re.M))

    def ready(self):
        return self.health.get("/readyz").status_code == 200

    def serving(self):
        """As gRPC tells it."""
        answer = HealthStub(self.channel).Check(health_pb2.HealthCheckRequest(), timeout=PATIENCE)
        return answer.status == health_pb2.HealthCheckResponse.SERVING

    def footprint(self):
        top = psutil.Process(self.process.pid)
        family = [top, *top.children(recursive=True)]
        return Footprint(
            sum(each.num_threads() for each in family),
            sum(each.num_fds() for each in family),
            sum(each.memory_info().rss for each in family) / 2**20,
        )

    def most_mb(self):
        """Resident memory at its highest since `forget_most`."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) / 2**10

    def forget_most(self):
        Path(f"/proc/{self.process.pid}/clear_refs").write_text("5")

    def internal_errors(self):
        return [line for line in self.log if "internal error" in line or '"level": "error"' in line]

    def ask_rest(self, points=POINTS, headers=None, **query):
        return self.rest.post(
            "/v1/recognise", params=query, content=points.tobytes(), headers=PACKED | (headers or {})
        )

    def ask_grpc(self, points=POINTS, options=None, timeout=PATIENCE, **fields):
        return self.stub.Recognise(request(points, options, **fields), timeout=timeout)

    def answers_good_requests(self):
        """One through every door, in every form of request."""
        contact = pb.Contact(points=POINTS.tobytes(), sensor_height_m=HEIGHT_M)
        assert self.ask_rest(sensor_height_m=HEIGHT_M).status_code == 200
        body = {"points": rows(POINTS), "sensor_height_m": HEIGHT_M}
        assert self.rest.post("/v1/recognise", json=body).status_code == 200
        assert self.rest.post("/v1/scan", json={"contacts": [body]}).json()["results"][0]["recognition"]
        assert self.ask_grpc(sensor_height_m=HEIGHT_M).recognition.vessel
        scan = self.stub.RecogniseScan(pb.RecogniseScanRequest(contacts=[contact] * 2), timeout=PATIENCE)
        assert all(result.recognition.vessel for result in scan.results)
        messages = iter([pb.RecogniseStreamRequest(sequence=1, contacts=[contact])])
        (answer,) = self.stub.RecogniseStream(messages, timeout=PATIENCE)
        assert answer.results[0].recognition.vessel
        for infer in (by_json, by_grpc_raw):
            assert infer(self, {"points": POINTS, "sensor_height_m": np.array([HEIGHT_M])}).outputs["vessel"]

    @contextmanager
    def survives(self, *, internal=0, grows_mb=ROOM_MB):
        """Do something to the service; afterwards it is ready, and nothing is lost, left over or grown.

        Args:
            internal: Internal errors that the fault is meant to be, each of which the log must tell; None: any.
            grows_mb: Memory that it may hold on to.
        """
        self.answers_good_requests()  # so that the connections of these clients count before as they do afterwards
        eventually(self._idle)
        counted, held, told = self.counts(), self.footprint(), len(self.internal_errors())
        assert counted.pending == 0
        yield
        eventually(self.ready)
        eventually(self.serving)
        self.answers_good_requests()
        eventually(self._idle)
        since = self.counts().since(counted)
        assert since.offered - since.refused == since.settled, since
        if internal is not None:  # the log is read by a thread, which may be behind
            eventually(lambda: len(self.internal_errors()) - told >= internal)
            assert len(new := self.internal_errors()[told:]) == internal, new
        assert self.process.poll() is None
        eventually(lambda: self.footprint().descriptors <= held.descriptors + 2, self.footprint)
        eventually(lambda: self.footprint().threads <= held.threads + THREADS, self.footprint)
        grown = self.footprint().rss_mb - held.rss_mb
        assert grown <= grows_mb, f"{grown:.0f} MB more than before"

    def _idle(self):
        status = self.admin.get("/admin/status").json()
        slots = status["contacts"]["pending"], status["queue_depth"], status["running"]
        return slots == (0, 0, 0) and self.metric("shipshape_in_flight") == 0

    def warm_up(self):
        """Let it start what it starts when it is first needed: threads of pools, the process for large JSON."""
        large = {"points": rows(cluster(20_000)), "sensor_height_m": HEIGHT_M}
        assert self.rest.post("/v1/recognise", json=large).status_code == 200
        threads, calm = 0, 0
        while calm < CALM:
            slow = request(POINTS, contact_id="slow", sensor_height_m=HEIGHT_M)
            calls = [self.stub.Recognise.future(slow) for _ in range(BURST)]
            for call in calls:
                call.exception(PATIENCE)
            now = self.footprint().threads
            calm = calm + 1 if now <= threads else 0
            threads = max(now, threads)


@contextmanager
def live(folder, command=("-c", FAULTY), more=None, warm=True, **settings):
    """A service that is ready until the end of the block, with these settings and `more` variables.

    It notes in the file `journal` of the folder which stage of which contact begins.
    """
    (folder / "tokens").write_text(f"ops {hashlib.sha256(TOKEN.encode()).hexdigest()}\n")
    variables = {
        "ADMIN_PORT": "0",
        "ADMIN_TOKEN_FILE": str(folder / "tokens"),
        "HEALTH_PORT": "0",
        "WORKERS": str(WORKERS),
        "MAX_CONTACTS": str(MAX_CONTACTS),
        "QUEUE_LIMIT": str(QUEUE_LIMIT),
        "DEFAULT_TIMEOUT_MS": str(PATIENCE * 1e3),
        **settings,
    }
    environment = {f"SHIPSHAPE_{name}": value for name, value in variables.items()} | (more or {})
    files = {"RELEASE": str(folder / "release"), "JOURNAL": str(folder / "journal")}
    with start(*command, **files, **environment) as process, ExitStack() as stack:
        stack.callback(process.kill)
        log = []
        rest, rpc, health, admin = _ports(process, log)
        reading = threading.Thread(target=lambda: log.extend(iter(process.stderr.readline, "")), daemon=True)
        reading.start()
        options = {"timeout": PATIENCE, "trust_env": False, "limits": httpx.Limits(max_keepalive_connections=1)}
        clients = [
            stack.enter_context(httpx.Client(base_url=f"http://127.0.0.1:{port}", headers=headers, **options))
            for port, headers in ((rest, {}), (admin, {"Authorization": f"Bearer {TOKEN}"}), (health, {}))
        ]
        channel = stack.enter_context(grpc.insecure_channel(f"127.0.0.1:{rpc}"))
        service = Live(process, *clients, channel, rpc, folder / "release", log)
        if warm:
            service.warm_up()
            service.answers_good_requests()
        yield service
        process.kill()
        reading.join(PATIENCE)


def _ports(process, log):
    for line in process.stderr:
        log.append(line)
        if (message := json.loads(line)["message"]).startswith("ready: "):
            found = re.search(
                r"REST http://\S+?:(\d+), gRPC \S+?:(\d+), health port (\d+), admin port (\d+)", message
            )
            return [int(port) for port in found.groups()]
    pytest.fail(f"it ended with {process.wait(PATIENCE)} before it was ready: {log[-3:]}")


def eventually(condition, told=lambda: ""):
    """Wait until something has come true, however slow the machine is, and give it; else say what `told` tells."""
    end = time.monotonic() + PATIENCE
    while not (what := condition()):
        if time.monotonic() > end:
            pytest.fail(f"it never came true {told()}")
        time.sleep(LOOK_S)
    return what


def without_proxies():
    """The environment of clients in processes of their own."""
    return {name: value for name, value in os.environ.items() if not name.lower().endswith("_proxy")}
