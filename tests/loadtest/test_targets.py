"""Each protocol against a real server on a real event loop: what it sends, and how it counts what comes back."""

import asyncio
import json
from contextlib import asynccontextmanager

import numpy as np
import pytest
from aiohttp import web

from loadtest.simulated import CLUSTER
from serving.fakes import DIGEST, cluster, request, running
from shipshape.errors import FileError, SettingsError
from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.precise import precise_loop
from shipshape.loadtest.targets import target_at
from shipshape.loadtest.targets.address import Keys, parse_address
from shipshape.loadtest.targets.channels import of_error
from shipshape.loadtest.targets.grpc import GrpcTarget
from shipshape.loadtest.targets.rest import RestTarget
from shipshape.loadtest.targets.target import TargetError
from shipshape.v1 import shipshape_pb2 as pb

PATIENCE_S = 10.0
DOORS = ("grpc", "stream", "rest")
ALL_DOORS = (*DOORS, "oip_rest", "oip_grpc")
ONE, THREE = Request((cluster(),)), Request((cluster(40), cluster(60), cluster(10)))


def run(coroutine):
    with asyncio.Runner(loop_factory=precise_loop) as runner:
        return runner.run(coroutine)


def address(url, **keys):
    return parse_address(url, Keys(**keys), connections=2)


def urls(doors):
    ports = doors.addresses
    grpc, rest = f"127.0.0.1:{ports.grpc_port}", f"127.0.0.1:{ports.rest_port}"
    return {
        "grpc": f"grpc://{grpc}",
        "stream": f"grpc+stream://{grpc}",
        "rest": f"http://{rest}",
        "oip_rest": f"oip+http://{rest}/shipshape",
        "oip_grpc": f"oip+grpc://{grpc}/shipshape",
    }


@asynccontextmanager
async def opened(url, **keys):
    target = target_at(address(url, **keys))
    info = await target.open()
    try:
        yield target, info
    finally:
        await target.close()


async def asked(url, *requests, deadline_s=PATIENCE_S):
    async with opened(url) as (target, _):
        return await asyncio.gather(*(target.send(target.encode(each), deadline_s) for each in requests))


@pytest.mark.parametrize("door", DOORS)
def test_what_the_service_says_of_itself(doors, door):
    async def described():
        async with opened(urls(doors)[door]) as (_, info):
            return info

    info = run(described())
    assert (info.bundle_name, info.bundle, info.budget_ms) == ("fake", DIGEST, 50.0)
    assert info.version


@pytest.mark.parametrize("door", ALL_DOORS)
def test_single_contacts_and_scans_are_answered(doors, door):
    doors.pipeline.computed.clear()
    replies = run(asked(urls(doors)[door], ONE, THREE, ONE))
    assert [reply.outcome for reply in replies] == [Outcome.OK] * 3
    assert len(doors.pipeline.computed) == 5


@pytest.mark.parametrize("clusters", [ONE.clusters, THREE.clusters], ids=["one", "scan"])
def test_lanes_go_along(doors, clusters):
    request = Request(clusters, "batch")
    for door in DOORS:
        assert [reply.outcome for reply in run(asked(urls(doors)[door], request))] == [Outcome.OK]
    message = GrpcTarget(address("grpc://127.0.0.1:1")).encode(request).message
    kind = pb.RecogniseRequest if len(clusters) == 1 else pb.RecogniseScanRequest
    assert kind.FromString(message).options.lane == pb.LANE_BATCH
    path, body, _ = RestTarget(address("http://127.0.0.1:1")).encode(request)
    assert path == "/v1/recognise?lane=batch" if len(clusters) == 1 else json.loads(body)["lane"] == "batch"


@pytest.mark.parametrize("door", ALL_DOORS)
@pytest.mark.parametrize("bad", [Request((CLUSTER[:1],)), Request((cluster(), CLUSTER[:1]))], ids=["one", "scan"])
def test_a_contact_that_is_refused_for_good_is_an_error_with_its_words(doors, door, bad):
    (reply,) = run(asked(urls(doors)[door], bad))
    assert reply.outcome is Outcome.ERROR
    assert "expected" in reply.detail


@pytest.mark.parametrize("door", ALL_DOORS)
def test_a_full_queue_refuses_and_a_deadline_expires(door):
    with running(queue_limit=2, max_contacts=2) as doors:
        held = doors.stub.Recognise.future(request(cluster(), contact_id="hold"), timeout=PATIENCE_S)
        assert doors.pipeline.entered.acquire(timeout=PATIENCE_S)

        async def crowded():
            async with opened(urls(doors)[door]) as (target, _):
                (late,) = await asyncio.gather(target.send(target.encode(ONE), 0.05))
                pair = Request((cluster(), cluster()))
                waiting = asyncio.create_task(target.send(target.encode(pair), PATIENCE_S))
                while doors.service.executor.queue_depth < 2:
                    await asyncio.sleep(0)
                refused = await target.send(target.encode(ONE), PATIENCE_S)
                doors.pipeline.release.set()
                return late, refused, await waiting

        late, refused, waited = run(crowded())
        assert held.result().recognition.vessel == "tug"
    assert late.outcome is Outcome.EXPIRED
    assert refused.outcome is Outcome.REFUSED
    assert waited.outcome is Outcome.OK


@pytest.mark.parametrize("door", ALL_DOORS)
def test_a_service_that_leaves_is_unavailable_and_one_that_starts_cannot_be_tested(door):
    async def left(doors):
        async with opened(urls(doors)[door]) as (target, _):
            await asyncio.to_thread(doors.service.stop)
            return await target.send(target.encode(ONE), PATIENCE_S)

    with running() as doors:
        assert run(left(doors)).outcome is Outcome.UNAVAILABLE
    with running(opened=False) as doors, pytest.raises(TargetError, match=r"^expected .* got .*(503|UNAVAILABLE)"):
        run(asked(urls(doors)[door]))


def scan(error):
    """The answer to two contacts: one on the top rung, one with an error if there is any."""
    outputs = {"rung": ["full", "" if error else "full"], "error": ["", error], "detail": ["", "expected"]}
    return json.dumps({"outputs": [{"name": name, "data": data} for name, data in outputs.items()]}).encode()


ANSWERS = {
    "ok": (200, b'{"outputs":[{"name":"vessel","data":["tug"]}]}', Outcome.OK),
    "full": (200, b'{"outputs":[{"name":"rung","data":["full"]}]}', Outcome.OK),
    "degraded": (200, b'{"outputs":[{"name":"rung","data":["full","heading"]}]}', Outcome.DEGRADED),
    "scan": (200, scan(""), Outcome.OK),
    "late contact": (200, scan("deadline_exceeded"), Outcome.EXPIRED),
    "bad contact": (200, scan("unprocessable"), Outcome.ERROR),
    "refused": (429, b'{"error":"come back later"}', Outcome.REFUSED),
    "unavailable": (503, b"", Outcome.UNAVAILABLE),
    "expired": (504, b"gateway", Outcome.EXPIRED),
    "failed": (500, b"[]", Outcome.ERROR),
    "nonsense": (200, b"{", Outcome.ERROR),
    "errors without their details": (
        200,
        b'{"outputs":[{"name":"error","data":["internal"]},{"name":"detail","data":[]}]}',
        Outcome.ERROR,
    ),
    "another protocol": (200, b'{"outputs":[{}]}', Outcome.ERROR),
}


class Peer:
    """A server of the Open Inference Protocol that answers as it is told, and keeps what it was asked."""

    def __init__(self):
        self.answer, self.asked, self.headers = ANSWERS["ok"], [], []

    async def metadata(self, request):
        return web.json_response({"name": "m", "versions": ["3"], "platform": "peer"})

    async def infer(self, request):
        self.asked.append(await request.json())
        self.headers.append(request.headers)
        status, body, _ = self.answer
        return web.Response(status=status, body=body, content_type="application/json")

    @asynccontextmanager
    async def serving(self):
        app = web.Application()
        app.router.add_get("/v2/models/m", self.metadata)
        app.router.add_post("/v2/models/m/infer", self.infer)
        runner = web.AppRunner(app)
        await runner.setup()
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        host, port = runner.addresses[0][:2]
        try:
            yield f"oip+http://{host}:{port}/m"
        finally:
            await runner.cleanup()


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_of_the_open_inference_protocol_counts_as(name):
    async def ask():
        peer = Peer()
        peer.answer = ANSWERS[name]
        async with peer.serving() as url:
            return await asked(url, ONE)

    (reply,) = run(ask())
    assert reply.outcome is ANSWERS[name][2]
    assert bool(reply.detail) is not reply.outcome.answered


def test_ragged_clusters_are_two_tensors_and_the_token_and_deadline_go_along():
    async def ask():
        peer = Peer()
        async with peer.serving() as url, opened(url, token="secret") as (target, info):
            await target.send(target.encode(THREE), 0.25)
        return peer, info

    peer, info = run(ask())
    points, counts = peer.asked[0]["inputs"]
    assert (points["name"], points["datatype"], points["shape"]) == ("points", "FP32", [110, 3])
    assert np.array(points["data"], np.float32).reshape(-1, 3) == pytest.approx(np.concatenate(THREE.clusters))
    assert (counts["name"], counts["datatype"], counts["shape"], counts["data"]) == (
        "counts", "INT32", [3], [40, 60, 10],
    )  # fmt: skip
    assert peer.headers[0]["Authorization"] == "Bearer secret"
    assert peer.headers[0]["Shipshape-Timeout-Ms"] == "250"
    assert (info.version, info.bundle_name) == ("peer", "3")


def test_a_server_of_something_else_cannot_be_tested():
    async def ask():
        async with Peer().serving() as url:
            await asked(url.replace("oip+", "").removesuffix("/m"))

    with pytest.raises(TargetError, match=r"^expected 200 from http://127\.0\.0\.1:\d+/v1/model, got 404"):
        run(ask())


@pytest.mark.parametrize(
    "url", ["grpc://127.0.0.1:1", "http://127.0.0.1:1", "oip+http://127.0.0.1:1/m", "oip+grpc://127.0.0.1:1/m"]
)
def test_a_port_where_nobody_listens_cannot_be_tested(url):
    with pytest.raises(TargetError, match=r"^expected .*127\.0\.0\.1:1"):
        run(asked(url))


@pytest.mark.parametrize(
    "url", ["", "here", "grpc://", "grpc://host", "http://host:port", "http://[::1", "http://:80"]
)
def test_what_is_no_address_is_refused(url):
    with pytest.raises(SettingsError, match="expected a target like"):
        address(url)


@pytest.mark.parametrize("url", ["ftp://host:1", "oip+http://host:1", "oip+grpc://host:1"])
def test_an_unknown_protocol_or_a_missing_model_is_refused(url):
    with pytest.raises(SettingsError, match=r"^expected a (target that begins|model)"):
        target_at(address(url))


def test_keys_that_cannot_be_read_are_refused(tmp_path):
    for url in ("grpcs://127.0.0.1:1", "https://127.0.0.1:1", "oip+grpcs://127.0.0.1:1/m"):
        with pytest.raises(FileError, match="PEM"):
            run(target_at(address(url, ca=tmp_path / "none.pem")).open())


def test_an_error_that_only_a_newer_service_knows_counts_as_one():
    reply = of_error(pb.ContactError(kind=99, message="expected tides, got none"))
    assert (reply.outcome, reply.detail) == (Outcome.ERROR, "error 99: expected tides, got none")


def test_a_stream_that_breaks_is_opened_again():
    async def twice(doors):
        async with opened(urls(doors)["stream"]) as (target, _):
            first = await target.send(target.encode(ONE), PATIENCE_S)
            for stream in target._streams:
                stream.end()
            return first, *await asyncio.gather(*(target.send(target.encode(ONE), PATIENCE_S) for _ in range(4)))

    with running() as doors:
        assert [reply.outcome for reply in run(twice(doors))] == [Outcome.OK] * 5


def test_problem_documents_are_quoted(doors):
    (reply,) = run(asked(urls(doors)["rest"], Request((CLUSTER[:1],))))
    problem = doors.rest.post(
        "/v1/recognise", content=CLUSTER[:1].tobytes(), headers={"Content-Type": "application/octet-stream"}
    )
    assert reply.detail == f"{problem.status_code}: {json.loads(problem.content)['detail']}"
