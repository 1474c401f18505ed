"""Worker processes killed under load: replaced, what they had is answered UNAVAILABLE, the rest is untouched."""

import signal
import threading
import uuid
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import grpc
import httpx
import psutil
import pytest

from faults.live import PATIENCE, eventually
from serving.fakes import request
from serving.processes import MODELS, start, until_ready
from shipshape.executor.process_hand import MOST
from shipshape.sample import sample_contact
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

pytestmark = pytest.mark.skipif(
    not (MODELS / "manifest.toml").is_file(), reason="models/ has no manifest.toml yet"
)
CLIENTS = 4
MARK = uuid.uuid4().hex  # in the environment of the service and of all that it starts: orphans are found by it
OK, UNAVAILABLE = grpc.StatusCode.OK, grpc.StatusCode.UNAVAILABLE


@pytest.fixture(scope="module")
def service():
    """The process, its readiness, and a stub."""
    variables = {"SHIPSHAPE_BUNDLE": str(MODELS), "SHIPSHAPE_WORKERS": "2", "MARK": MARK}
    with start("-m", "shipshape", "serve", **variables) as process:
        try:
            rest, port = until_ready(process)
            threading.Thread(target=process.stderr.read, daemon=True).start()  # else its log would fill the pipe
            with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
                yield (
                    psutil.Process(process.pid),
                    lambda: httpx.get(f"http://127.0.0.1:{rest}/readyz", trust_env=False).status_code == 200,
                    ShipshapeStub(channel),
                )
            process.send_signal(signal.SIGTERM)
            assert process.wait(PATIENCE) == 0
        finally:
            process.kill()


def family(process):
    """The process that forks, and all workers, also those of a server that was killed."""
    (server,) = process.children()
    return server, [one for one in psutil.process_iter() if one not in (process, server) and marked(one)]


def whole(process):
    """Whether nobody is missing; while another server comes in the place of one that was killed, it is."""
    try:
        return len(family(process)[1]) == 2
    except ValueError:
        return False


def marked(one):
    try:
        return one.environ().get("MARK") == MARK and one.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False


def ask(stub):
    call = stub.Recognise.future(request(sample_contact().points_level), timeout=PATIENCE)
    call.exception()
    return call.code()


def asked_until(enough, stub):
    codes = []
    while not enough.is_set():
        codes.append(ask(stub))
    return codes


@pytest.mark.parametrize("victims", [["worker"], ["worker", "worker"], ["server", "worker"]])
def test_only_what_it_had_is_lost(service, victims):
    process, ready, stub = service
    enough = threading.Event()
    with ThreadPoolExecutor(CLIENTS) as pool:
        asking = [pool.submit(asked_until, enough, stub) for _ in range(CLIENTS)]
        try:
            for victim in victims:
                server, workers = family(process)
                killed = server if victim == "server" else workers[0]
                killed.kill()
                eventually(lambda killed=killed: not marked(killed))
                eventually(lambda: whole(process) and ready())
        finally:
            enough.set()
        codes = Counter(code for each in asking for code in each.result())
    assert set(codes) <= {OK, UNAVAILABLE}
    assert codes[OK] > 0
    assert codes[UNAVAILABLE] <= MOST * victims.count("worker")
    assert [ask(stub) for _ in range(8)] == [OK] * 8
