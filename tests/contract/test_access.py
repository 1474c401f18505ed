"""Who may come in: the same through both doors, in the same words, before anything of the request is read."""

import logging
import math
import re
import socket
import threading

import grpc
import pytest
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection_pb2, reflection_pb2_grpc

from serving.fakes import HALF, PATIENCE, cluster, refuses, request, rows, running, until
from shipshape.serving import reloading
from shipshape.serving.faults import FaultKind
from shipshape.serving.grpc.guard import STATUS as GRPC_STATUS
from shipshape.serving.rest.doorkeeper import OPEN
from shipshape.serving.rest.problems import STATUS as REST_STATUS
from shipshape.serving.tokens import hash_of
from shipshape.v1 import shipshape_pb2 as pb

FLEET, SHORE, UNKNOWN = "the-fleets-token", "the-shores-token", "a-token-nobody-holds"
GOOD = cluster()
NEVER = 1e-6  # contacts a second: no test waits for the next one


def bearer(token):
    return f"Bearer {token}"


def write(path, **tokens):
    path.touch(mode=0o600)
    path.write_text("".join(f"{name} {hash_of(token)}\n" for name, token in tokens.items()))
    return path


@pytest.fixture(scope="module")
def locked(tmp_path_factory):
    """A service that knows two tokens."""
    path = write(tmp_path_factory.mktemp("access") / "tokens", fleet=FLEET, shore=SHORE)
    with running(tokens_file=path) as doors:
        yield doors


def through_grpc(doors, *authorizations, **fields):
    """Kind of the outcome, its words, and the trailing metadata."""
    metadata = [("authorization", value) for value in authorizations]
    call = doors.stub.Recognise.future(request(GOOD, **fields), timeout=PATIENCE, metadata=metadata)
    if call.exception() is None:
        return "ok", "", {}
    trailing = dict(call.trailing_metadata())
    kind = FaultKind(trailing["shipshape-error"])
    assert call.code() is GRPC_STATUS[kind]
    return kind, call.details(), trailing


def through_rest(doors, *authorizations, **fields):
    """Kind of the outcome, its words, and the headers."""
    headers = [("Authorization", value) for value in authorizations]
    response = doors.rest.post("/v1/recognise", json={"points": rows(GOOD), **fields}, headers=headers)
    if response.status_code == 200:
        return "ok", "", response.headers
    body = response.json()
    kind = FaultKind(body["error"])
    assert response.status_code == body["status"] == REST_STATUS[kind]
    return kind, body["detail"], response.headers


DOORS = {"grpc": through_grpc, "rest": through_rest}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("given", [bearer(FLEET), bearer(SHORE), f"bearer {FLEET}", f"BEARER  {FLEET}"])
def test_who_holds_a_token_comes_in(locked, door, given):
    assert DOORS[door](locked, given)[0] == "ok"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((), "expected authorization: Bearer TOKEN once, got none"),
        (("Basic Zm9vOmJhcg==",), "expected authorization: Bearer TOKEN once, got another form"),
        ((FLEET,), "expected authorization: Bearer TOKEN once, got another form"),
        ((bearer(FLEET), bearer(FLEET)), "expected authorization: Bearer TOKEN once, got another form"),
        (("Bearer",), "expected a token that this service knows, got another"),
        ((bearer(UNKNOWN),), "expected a token that this service knows, got another"),
        ((bearer(hash_of(FLEET)),), "expected a token that this service knows, got another"),
        ((bearer(FLEET[:-1]),), "expected a token that this service knows, got another"),
        ((bearer(FLEET + SHORE),), "expected a token that this service knows, got another"),
    ],
)
def test_who_holds_none_does_not(locked, given, words):
    by_grpc, by_rest = through_grpc(locked, *given), through_rest(locked, *given)
    assert by_grpc[:2] == by_rest[:2] == (FaultKind.UNAUTHENTICATED, words)
    assert by_rest[2]["WWW-Authenticate"] == "Bearer"
    assert by_rest[2]["content-type"] == "application/problem+json"


def test_every_path_but_health_asks_for_a_token(locked):
    contract = locked.rest.get("/openapi.json", headers={"Authorization": bearer(FLEET)})
    misspelt = ("/livez/", "//livez", "//", "/console", "//console/main.js")
    for path in (*contract.json()["paths"], "/openapi.json", "/nowhere", "/v2/health/ready", *misspelt):
        for method in ("GET", "POST", "OPTIONS"):
            url = f"http://127.0.0.1:{locked.addresses.rest_port}{path}"  # whole: the client would mend it
            refused = locked.rest.request(method, url).status_code == 401
            assert refused is (path not in OPEN), f"{method} {path}"
    assert locked.rest.get("/readyz").json() == {"status": "ready"}
    assert all(locked.rest.get(path).status_code != 401 for path in ("/", "/console/main.js"))


def test_every_service_but_health_asks_for_a_token(locked):
    def code(call):
        return call.code()

    for method in ("Recognise", "RecogniseScan", "GetModelInfo", "Nothing"):
        ask = locked.channel.unary_unary(f"/shipshape.v1.Shipshape/{method}")
        assert code(ask.future(b"", timeout=PATIENCE)) is grpc.StatusCode.UNAUTHENTICATED
    reflection = reflection_pb2_grpc.ServerReflectionStub(locked.channel).ServerReflectionInfo
    question = reflection_pb2.ServerReflectionRequest(list_services="")
    assert code(reflection(iter([question]), timeout=PATIENCE)) is grpc.StatusCode.UNAUTHENTICATED
    asked = reflection(iter([question]), timeout=PATIENCE, metadata=[("authorization", bearer(FLEET))])
    assert "shipshape.v1.Shipshape" in {service.name for service in next(asked).list_services_response.service}
    health = health_pb2_grpc.HealthStub(locked.channel).Check(health_pb2.HealthCheckRequest(), timeout=PATIENCE)
    assert health.status == health_pb2.HealthCheckResponse.SERVING


def test_a_body_is_not_waited_for(locked):
    with socket.create_connection(("127.0.0.1", locked.addresses.rest_port), PATIENCE) as connection:
        connection.sendall(HALF)
        assert connection.recv(100).startswith(b"HTTP/1.1 401 ")


def test_a_message_is_not_waited_for(locked):
    asked = threading.Event()

    def never():
        asked.wait(PATIENCE)
        yield from ()

    ask = locked.channel.stream_stream("/shipshape.v1.Shipshape/Recognise")
    call = ask(never(), timeout=PATIENCE)
    assert call.code() is grpc.StatusCode.UNAUTHENTICATED
    asked.set()


@pytest.mark.parametrize("door", DOORS)
def test_a_revoked_token_is_refused_while_the_others_go_on(tmp_path, monkeypatch, door):
    monkeypatch.setattr(reloading, "LOOK_S", 0.0)
    path = write(tmp_path / "tokens", fleet=FLEET, shore=SHORE)
    with running(tokens_file=path) as doors:
        assert DOORS[door](doors, bearer(FLEET))[0] == "ok"
        write(path, shore=SHORE)
        assert DOORS[door](doors, bearer(FLEET))[0] is FaultKind.UNAUTHENTICATED
        assert DOORS[door](doors, bearer(SHORE))[0] == "ok"


def test_no_log_line_and_no_answer_quotes_a_token(locked, caplog):
    caplog.set_level(logging.DEBUG)
    said = [DOORS[door](locked, given) for door in DOORS for given in (bearer(FLEET), bearer(UNKNOWN), UNKNOWN)]
    assert [kind for kind, _, _ in said] == ["ok", FaultKind.UNAUTHENTICATED, FaultKind.UNAUTHENTICATED] * 2
    assert "expected a token that this service knows" in caplog.text
    assert "127.0.0.1" in caplog.text
    for secret in (FLEET, UNKNOWN):
        assert secret not in caplog.text + repr(said)


def test_refusals_are_counted_by_reason(locked):
    def counted():
        text = locked.rest.get("/metrics", headers={"Authorization": bearer(FLEET)}).text
        found = re.search(r'shipshape_client_refusals_total\{reason="token"\} (\S+)', text)
        return float(found[1]) if found else 0.0

    before = counted()
    through_grpc(locked)
    through_rest(locked, bearer("x"))
    assert counted() == before + 2


def test_a_token_has_its_own_share_through_both_doors_together(tmp_path):
    path = write(tmp_path / "tokens", fleet=FLEET, shore=SHORE)
    limits = {"client_contacts_per_s": NEVER, "client_burst": 2, "max_contacts": 1}
    with running(tokens_file=path, **limits) as doors:
        for token in (FLEET, SHORE):
            assert [through_grpc(doors, bearer(token))[0], through_rest(doors, bearer(token))[0]] == ["ok", "ok"]
            for ask in DOORS.values():
                kind, words, _ = ask(doors, bearer(token))
                assert kind is FaultKind.OVERLOADED
                assert words.startswith("expected at most 1e-06 contacts a second of one client, 2 at once, got 1")
        info = doors.stub.GetModelInfo(
            pb.GetModelInfoRequest(), timeout=PATIENCE, metadata=[("authorization", bearer(FLEET))]
        )
        assert info.bundle_name == "fake", "what brings no contact is not limited"


def test_a_refusal_says_when_to_come_back():
    with running(client_contacts_per_s=0.01, client_burst=1, max_contacts=1) as doors:
        assert through_rest(doors)[0] == "ok"
        by_grpc, by_rest = through_grpc(doors)[2], through_rest(doors)[2]
        for seconds in (int(by_grpc["grpc-retry-pushback-ms"]) / 1e3, int(by_rest["Retry-After"])):
            assert 0 < seconds <= 100
        assert math.ceil(int(by_grpc["grpc-retry-pushback-ms"]) / 1e3) >= int(by_rest["Retry-After"])


def test_an_address_is_a_client_and_no_header_changes_it():
    with running(client_contacts_per_s=NEVER, client_burst=1, max_contacts=1) as doors:
        assert through_rest(doors)[0] == "ok"
        assert through_grpc(doors)[0] is FaultKind.OVERLOADED
        posed = {"X-Forwarded-For": "10.9.8.7", "Forwarded": "for=10.9.8.7"}
        assert doors.ask_rest(GOOD, headers=posed).status_code == 429


@pytest.mark.parametrize("method", ["scan", "recognise"])
def test_contacts_under_way_are_limited_and_given_back(method):
    held = {"points": rows(GOOD), "contact_id": "hold"}
    body = held if method == "recognise" else {"contacts": [held]}
    with running(client_under_way=1, max_contacts=1) as doors:
        slow = threading.Thread(target=lambda: doors.kept.append(doors.rest.post(f"/v1/{method}", json=body)))
        slow.start()
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        by_grpc, by_rest = through_grpc(doors), through_rest(doors)
        assert by_grpc[:2] == by_rest[:2]
        assert by_grpc[:2] == (
            FaultKind.OVERLOADED,
            "expected at most 1 contacts of one client under way, got 1 beside 1",
        )
        assert "Retry-After" not in by_rest[2]
        doors.pipeline.release.set()
        slow.join(PATIENCE)
        assert doors.kept[0].status_code == 200
        until(lambda: through_grpc(doors)[0] == "ok")
        assert through_rest(doors)[0] == "ok"


def test_a_scan_takes_as_many_as_it_has_contacts_and_too_many_are_told_so():
    with running(client_contacts_per_s=NEVER, client_burst=9, max_contacts=4) as doors:
        scan = pb.RecogniseScanRequest(contacts=[request(GOOD).contact] * 4)
        doors.stub.RecogniseScan(scan, timeout=PATIENCE)
        assert doors.rest.post("/v1/scan", json={"contacts": [{"points": rows(GOOD)}] * 4}).status_code == 200
        assert [through_grpc(doors)[0], through_grpc(doors)[0]] == ["ok", FaultKind.OVERLOADED]
    with running(client_contacts_per_s=NEVER, client_burst=4, max_contacts=4) as doors:
        assert doors.rest.post("/v1/scan", json={"contacts": [{}] * 5}).json()["error"] == FaultKind.TOO_LARGE


def test_a_service_that_starts_asks_for_tokens_too(tmp_path):
    path = write(tmp_path / "tokens", fleet=FLEET)
    with running(opened=False, tokens_file=path) as doors:
        assert not refuses(doors)
        assert through_rest(doors)[0] is FaultKind.UNAUTHENTICATED
        assert through_rest(doors, bearer(FLEET))[0] is FaultKind.NOT_READY
        assert through_grpc(doors, bearer(FLEET))[0] is FaultKind.NOT_READY
        assert doors.rest.get("/readyz").status_code == 503
