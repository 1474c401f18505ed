"""The admin door: a token for every call, one table of errors, and the command line that makes the calls."""

import hashlib
import json
import socket
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import httpx
import pytest

from serving.fakes import DIGEST, PATIENCE, FakePipeline, cluster, fake_model, running
from serving.http_calls import read
from shipshape import admin_calls
from shipshape.cli import main
from shipshape.errors import BundleError, InvalidInput, SettingsError
from shipshape.serving.admin.control import folder_below
from shipshape.settings import load_settings

TOKEN = "a token that nobody guesses"
OTHER = "cd" * 32
CALLS = [
    ("GET", "/admin/status"),
    ("POST", "/admin/bundle"),
    ("POST", "/admin/rollback"),
    ("POST", "/admin/drain"),
    ("POST", "/admin/resume"),
]


def load(folder):
    if folder.name == "bad":
        raise BundleError("expected sha256 1 of prior.onnx, got 2")
    if folder.name == "odd":
        raise ZeroDivisionError
    if folder.name in ("first", "same"):
        return fake_model(FakePipeline())
    return fake_model(FakePipeline(), name="other", digest=OTHER)


@contextmanager
def administered(tmp_path, **more):
    """A service with an admin door, and a client of it that holds the token."""
    for name in ("first", "second", "same", "bad", "odd"):
        (tmp_path / "bundles" / name).mkdir(parents=True)
    tokens = tmp_path / "admin.tokens"
    tokens.write_text(f"ops {hashlib.sha256(TOKEN.encode()).hexdigest()}\n")
    settings = {"admin_port": 0, "admin_token_file": tokens, "bundle": tmp_path / "bundles/first", **more}
    with running(load=load, **settings) as doors:
        url = f"http://127.0.0.1:{doors.addresses.admin_port}"
        headers = {"Authorization": f"Bearer {TOKEN}"}
        with httpx.Client(base_url=url, headers=headers, timeout=PATIENCE, trust_env=False) as admin:
            yield doors, admin


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    with administered(tmp_path_factory.mktemp("admin")) as both:
        yield both


@pytest.fixture
def both(shared):
    """One service for most tests; each finds it ready with the first bundle."""
    _, admin = shared
    yield shared
    admin.post("/admin/resume")
    admin.post("/admin/bundle", json={"folder": "first"})


@pytest.mark.parametrize(("token", "status"), [("wrong", 401), (TOKEN, 413)])
def test_strangers_are_refused_before_their_body_is_read_and_operators_send_little(both, token, status):
    doors, _ = both
    address = "127.0.0.1", doors.addresses.admin_port
    lines = (
        "Host: x",
        f"Authorization: Bearer {token}",
        "Content-Type: application/json",
        "Content-Length: 99999",
    )
    head = "POST /admin/bundle HTTP/1.1\r\n" + "".join(f"{line}\r\n" for line in lines) + "\r\n"
    with socket.create_connection(address, PATIENCE) as client, client.makefile("rb") as answers:
        client.sendall(head.encode())
        assert read(answers)[0] == status


@pytest.mark.parametrize("header", [None, "", "Bearer", "Bearer wrong", f"Basic {TOKEN}", TOKEN, "Bearer \u00e4"])
def test_no_call_without_the_token(both, header):
    doors, admin = both
    headers = {} if header is None else {"Authorization": header.encode()}
    with httpx.Client(base_url=admin.base_url, headers=headers, timeout=PATIENCE, trust_env=False) as stranger:
        for method, path in CALLS:
            answer = stranger.request(method, path, json={"folder": "second"})
            assert (answer.status_code, answer.json()["error"]) == (401, "unauthenticated")
            assert answer.headers["WWW-Authenticate"] == "Bearer"
            assert answer.headers["Content-Type"] == "application/problem+json"
            assert "guess" not in answer.text
    assert doors.service.health.ready
    assert doors.service.models.running.model.bundle.digest == DIGEST


def test_status(both):
    doors, admin = both
    before = admin.get("/admin/status").json()
    doors.ask_rest(cluster())
    status = admin.get("/admin/status").json()
    assert (status["state"], status["started"], status["live"], status["ready"]) == ("ready", True, True, True)
    assert status["bundle"]["name"] == "fake"
    assert status["bundle"]["digest"] == DIGEST
    assert status["bundle"]["folder"].endswith("bundles/first")
    for count in ("offered", "completed"):
        assert status["contacts"][count] == before["contacts"][count] + 1
    assert status["contacts"]["pending"] == status["queue_depth"] == status["running"] == 0
    assert status["uptime_s"] > 0


def test_swap_and_rollback(both):
    doors, admin = both
    swapped = admin.post("/admin/bundle", json={"folder": "second"}).json()
    assert (swapped["bundle"]["digest"], swapped["previous"]["digest"]) == (OTHER, DIGEST)
    assert doors.rest.get("/v1/model").json()["bundle"] == OTHER
    back = admin.post("/admin/rollback").json()
    assert (back["bundle"]["digest"], back["previous"]["digest"]) == (DIGEST, OTHER)
    assert doors.rest.get("/v1/model").json()["bundle"] == DIGEST


def test_nothing_to_roll_back_to_is_a_conflict(tmp_path):
    with administered(tmp_path) as (_, admin):
        answer = admin.post("/admin/rollback")
    assert (answer.status_code, answer.json()["error"], answer.json()["title"]) == (409, "conflict", "Conflict")
    assert answer.json()["detail"] == "expected a bundle to roll back to, got a service that has run no other"


@pytest.mark.parametrize(
    ("folder", "detail"),
    [
        ("bad", "expected sha256 1 of prior.onnx, got 2"),
        ("odd", "expected the bundle to answer the built-in contact, got ZeroDivisionError:"),
    ],
)
def test_a_bundle_that_is_refused(both, folder, detail):
    doors, admin = both
    answer = admin.post("/admin/bundle", json={"folder": folder})
    assert (answer.status_code, answer.json()["error"]) == (422, "bundle_refused")
    assert answer.json()["detail"] == detail
    assert doors.rest.get("/v1/model").json()["bundle"] == DIGEST


@pytest.mark.parametrize("body", [{}, {"folder": 7}, {"folder": None}, [], "second"])
def test_a_body_of_another_form(both, body):
    _, admin = both
    answer = admin.post("/admin/bundle", json=body)
    assert (answer.status_code, answer.json()["error"]) == (400, "invalid_input")


@pytest.mark.parametrize(
    "folder", ["..", "../elsewhere", "/etc", ".", "", "a/../..", "out", "missing", "nul\0", "x" * 5000]
)
def test_bundles_come_from_below_the_root_alone(both, folder):
    doors, admin = both
    root = doors.service.models.running.folder.parent
    if not (root / "out").exists():
        (root / "out").symlink_to(root.parent)
    answer = admin.post("/admin/bundle", json={"folder": folder})
    assert (answer.status_code, answer.json()["error"]) == (400, "invalid_input")
    assert doors.rest.get("/v1/model").json()["bundle"] == DIGEST


def test_links_that_stay_below_the_root_are_followed(tmp_path):
    (tmp_path / "v2").mkdir()
    (tmp_path / "current").symlink_to("v2")
    assert folder_below(tmp_path, "current") == folder_below(tmp_path, str(tmp_path / "v2")) == tmp_path / "v2"
    (tmp_path / "round").symlink_to("round")
    with pytest.raises(InvalidInput):
        folder_below(tmp_path, "round")


def test_drain_and_resume(both):
    doors, admin = both
    drained = admin.post("/admin/drain").json()
    assert (drained["state"], drained["live"], drained["ready"]) == ("drained", True, False)
    assert doors.rest.get("/readyz").status_code == 503
    assert doors.ask_rest(cluster()).status_code == 200
    assert admin.post("/admin/resume").json()["ready"]
    assert doors.rest.get("/readyz").status_code == 200


def test_a_stop_cannot_be_taken_back(tmp_path):
    with administered(tmp_path) as (doors, admin):
        doors.service.leave()
        answers = [admin.post("/admin/resume"), admin.post("/admin/bundle", json={"folder": "second"})]
        kinds = [(answer.status_code, answer.json()["error"]) for answer in answers]
        assert kinds == [(409, "conflict"), (503, "not_ready")]
        assert admin.get("/admin/status").json()["state"] == "stopping"


def test_the_admin_door_needs_a_token_file(tmp_path):
    with pytest.raises(SettingsError, match=r"^expected SHIPSHAPE_ADMIN_TOKEN_FILE beside SHIPSHAPE_ADMIN_PORT"):
        load_settings(admin_port=0)
    nowhere = {"admin_port": 0, "admin_token_file": tmp_path / "nowhere"}
    with pytest.raises(SettingsError, match="nowhere"), running(**nowhere):
        pass


def test_no_other_door_answers_admin_calls(both):
    doors, admin = both
    for method, path in CALLS:
        assert doors.rest.request(method, path, headers=admin.headers).status_code == 404
    assert admin.get("/v1/model").status_code == 404


def call(admin, tmp_path, *words):
    token = tmp_path / "admin.token"
    token.write_text(f"{TOKEN}\n")
    return main(["admin", *words, "--url", str(admin.base_url), "--token-file", str(token)])


def test_the_command_line(both, tmp_path, capsys):
    doors, admin = both
    for words, state in ((["status"], "ready"), (["drain"], "drained"), (["resume"], "ready")):
        assert call(admin, tmp_path, *words) == 0
        assert json.loads(capsys.readouterr().out)["state"] == state
    assert call(admin, tmp_path, "swap", "second") == 0
    assert json.loads(capsys.readouterr().out)["bundle"]["name"] == "other"
    assert call(admin, tmp_path, "rollback") == 0
    assert doors.rest.get("/v1/model").json()["bundle"] == DIGEST
    capsys.readouterr()
    assert call(admin, tmp_path, "swap", "bad") == 1
    assert capsys.readouterr().err == "shipshape: expected sha256 1 of prior.onnx, got 2\n"


def test_who_waits_at_a_terminal_sees_the_seconds(both, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(admin_calls, "TICK_S", 1e-4)
    assert call(both[1], tmp_path, "swap", "second") == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["bundle"]["name"] == "other"
    assert said.err.startswith("\rswap: 0 s")
    assert said.err.endswith("\r\033[K")


def test_the_command_line_without_a_door_or_a_token(tmp_path, capsys):
    class Nowhere:
        base_url = "http://127.0.0.1:1"

    assert call(Nowhere, tmp_path, "status") == 1
    assert capsys.readouterr().err.startswith("shipshape: expected an admin door at http://127.0.0.1:1, got: ")
    assert main(["admin", "status", "--token-file", str(tmp_path / "nowhere")]) == 2
    assert "expected to read a token from" in capsys.readouterr().err
    assert main(["admin", "status", "--url", "file:x", "--token-file", str(tmp_path / "admin.token")]) == 2


@pytest.mark.parametrize("said", [b"\0\0\x12\4\0\n", b"HTTP/1.1 200 OK\r\nContent-Length: 6\r\n\r\n<html>"])
def test_the_command_line_at_another_kind_of_door(said, tmp_path, capsys):
    with socket.create_server(("127.0.0.1", 0)) as door, ThreadPoolExecutor(1) as pool:
        pool.submit(say, door, said)

        class Another:
            base_url = f"http://127.0.0.1:{door.getsockname()[1]}"

        assert call(Another, tmp_path, "status") == 1
    error = capsys.readouterr().err
    assert error.startswith(f"shipshape: expected an admin door at {Another.base_url}, got ")
    assert error.endswith(": is --url the address of the service's SHIPSHAPE_ADMIN_PORT?\n")


def say(door, what):
    """Answer one caller."""
    caller, _ = door.accept()
    with caller:
        caller.recv(4096)
        caller.sendall(what)


def test_two_swaps_at_a_time_are_a_conflict(both):
    doors, admin = both
    with doors.service.models._alone():
        answer = admin.post("/admin/bundle", json={"folder": "second"})
    assert (answer.status_code, answer.json()["error"]) == (409, "conflict")
    assert admin.post("/admin/bundle", json={"folder": "same"}).json()["bundle"]["digest"] == DIGEST
