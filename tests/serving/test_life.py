"""Starts that fail: one sentence on stderr, exit code 1, nothing left open."""

import re
import signal
import socket

import pytest

from serving.fakes import PNG, FakeBundle, FakePipeline
from shipshape.serving import life
from shipshape.settings import Settings


@pytest.fixture(autouse=True)
def _leave_the_test_process_as_it_was(monkeypatch):
    monkeypatch.setattr(life, "configure_logging", lambda level: None)
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def _fakes(monkeypatch):
    monkeypatch.setattr(life, "load_bundle", lambda path: FakeBundle())
    monkeypatch.setattr(life, "Pipeline", lambda bundle, limits: FakePipeline())
    monkeypatch.setattr(life, "render_png", lambda contact, recognition: PNG)


def test_a_missing_bundle(tmp_path, capsys):
    assert life.serve(Settings(rest_port=0, grpc_port=0, bundle=tmp_path / "nowhere")) == 1
    assert re.fullmatch(r"shipshape: expected .+nowhere.*, got .+\n", capsys.readouterr().err)


@pytest.mark.usefixtures("_fakes")
@pytest.mark.parametrize("door", ["rest_port", "grpc_port"])
def test_a_taken_port(door, capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert life.serve(Settings(**{"rest_port": 0, "grpc_port": 0, door: port})) == 1
    assert capsys.readouterr().err.startswith(f"shipshape: expected to listen on 127.0.0.1:{port}")


@pytest.mark.usefixtures("_fakes")
def test_a_bundle_that_fails_its_warm_up(monkeypatch, capsys):
    monkeypatch.setattr(life, "Pipeline", lambda bundle, limits: None)
    assert life.serve(Settings(rest_port=0, grpc_port=0)) == 1
    assert "expected bundle fake to answer the built-in contact, got " in capsys.readouterr().err


@pytest.mark.usefixtures("_fakes")
def test_a_signal_during_the_start_is_not_lost(monkeypatch):
    def warm_up_slowly(service, model):
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(life.Service, "open", warm_up_slowly)
    assert life.serve(Settings(rest_port=0, grpc_port=0)) == 0
