"""Starts that fail: one sentence on stderr, the exit code that `shipshape --help` lists, nothing left open."""

import os
import queue
import re
import signal
import socket
import threading

import pytest

from serving.fakes import FAKE_BUNDLE, PATIENCE, FakePipeline, fake_model
from shipshape.errors import BundleError
from shipshape.serving import life
from shipshape.serving.core import Core
from shipshape.serving.local_model import LocalModel
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
    monkeypatch.setattr(life, "load_model", lambda settings, runtime, folder: fake_model(FakePipeline()))


def test_a_missing_bundle(tmp_path, capsys):
    assert life.serve(Settings(rest_port=0, grpc_port=0, bundle=tmp_path / "nowhere")) == 2
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
    monkeypatch.setattr(life, "load_model", lambda settings, runtime, folder: LocalModel(FAKE_BUNDLE, None, None))
    assert life.serve(Settings(rest_port=0, grpc_port=0)) == 1
    assert "expected bundle fake to answer the built-in contact, got " in capsys.readouterr().err


@pytest.mark.usefixtures("_fakes")
def test_a_bundle_that_turns_out_wrong_in_its_warm_up(monkeypatch):
    def find_out(service, model):
        raise BundleError("expected a network, got none")

    monkeypatch.setattr(life.Service, "open", find_out)
    assert life.serve(Settings(rest_port=0, grpc_port=0)) == 2


@pytest.mark.usefixtures("_fakes")
def test_a_signal_during_the_warm_up_ends_it_before_it_is_ready(monkeypatch, caplog):
    entered, release = threading.Event(), threading.Event()
    ready = []

    def hang(pipeline, work):
        entered.set()
        assert release.wait(PATIENCE)

    monkeypatch.setattr(FakePipeline, "_prior", hang)
    monkeypatch.setattr(life, "LEAVE_S", 0.0)
    monkeypatch.setattr(Core, "open", lambda core, model: ready.append(model))
    caplog.set_level("INFO")
    signaller = threading.Thread(target=lambda: entered.wait(PATIENCE) and os.kill(os.getpid(), signal.SIGTERM))
    signaller.start()
    try:
        assert life.serve(Settings(rest_port=0, grpc_port=0)) == 0
    finally:
        release.set()
    for thread in [thread for thread in threading.enumerate() if thread.name == "warm-up"]:
        thread.join(PATIENCE)
    signaller.join()
    assert ready == []
    assert "ready: " not in caplog.text


def test_a_signal_an_instant_before_the_wait_is_not_slept_over():
    waits = []

    class Ends:
        """As when the signal's flag was set just before: its handler runs only after the wait."""

        def get(self, timeout=None):
            waits.append(timeout)
            if len(waits) == 1:
                assert timeout is not None, "this wait would never end"
                raise queue.Empty
            return signal.SIGTERM

    assert life._first(Ends()) == signal.SIGTERM
    assert len(waits) == 2
