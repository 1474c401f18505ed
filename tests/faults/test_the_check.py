"""The check after each fault finds what a fault may leave behind; else no other test here would mean much."""

import socket
from contextlib import ExitStack

import pytest

from faults import live
from faults.live import PATIENCE, POINTS, eventually
from serving.fakes import request

CONNECTIONS = 10


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(live, "PATIENCE", 0.3)


def after(service, fault, **allowed):
    with service.survives(**allowed):
        fault()


def test_open_connections_are_found(service, impatient):
    with ExitStack() as connections:

        def connect():
            for _ in range(CONNECTIONS):
                connections.enter_context(socket.create_connection(service.rest_address))

        with pytest.raises(pytest.fail.Exception, match="descriptors"):
            after(service, connect)


def test_a_request_that_is_never_answered_is_found(service, impatient):
    calls = []

    def hold():
        calls.append(service.stub.Recognise.future(request(POINTS, contact_id="wedge"), timeout=PATIENCE))
        eventually(lambda: service.metric("shipshape_running") == 1)

    with pytest.raises(pytest.fail.Exception, match="never came true"):
        after(service, hold)
    service.release.touch()
    assert calls.pop().result().recognition.vessel
    service.release.unlink()


def test_an_internal_error_that_nobody_meant_is_found(service):
    with pytest.raises(AssertionError, match="internal error"):
        after(service, lambda: service.ask_rest(contact_id="crash"))


def test_memory_that_stays_is_found(service):
    with pytest.raises(AssertionError, match="MB more than before"):
        after(service, service.ask_rest, grows_mb=-10_000)
