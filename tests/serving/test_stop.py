"""SIGTERM at random moments under load, a real process: nothing that was accepted is lost."""

import random
import signal
import threading
from contextlib import contextmanager

import grpc
import httpx
import pytest
from grpc_health.v1 import health_pb2
from grpc_health.v1.health_pb2_grpc import HealthStub

from serving.fakes import PATIENCE, cluster, request, until
from serving.processes import SERVE_FAKES, START_PATIENCE, start, stopped_by, until_ready
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

# Work takes its time, and leaves a trace: what was accepted is known, whatever the clients saw.
SERVE_SLOWLY = (
    """
import os
import time
from serving.fakes import FakePipeline
journal = os.open(os.environ["JOURNAL"], os.O_WRONLY | os.O_CREAT | os.O_APPEND)
def prior(self, work):
    if work.contact.contact_id != "sample":  # the warm-up's
        os.write(journal, (work.contact.contact_id + "\\n").encode())
    time.sleep(0.003)
FakePipeline._prior = prior
"""
    + SERVE_FAKES
)
POINTS = cluster()
PACKED = {"content-type": "application/octet-stream"}
OK, REFUSED, NO_SERVER = "ok", "refused", "no server"
CLOSED = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED)


class Load:
    """Clients of both doors that ask one question after the other until they are sent away."""

    def __init__(self, rest_port, grpc_port, *, heed=False):
        self.ends = {}  # how the request of each id ended
        self.heed = heed  # whether a client leaves as soon as the service is not ready, as behind a balancer
        self._url = f"http://127.0.0.1:{rest_port}/v1/recognise"
        self._target = f"127.0.0.1:{grpc_port}"
        asks = [self._by_rest, self._by_fresh_rest, self._by_grpc]
        self._threads = [
            threading.Thread(target=asks[index % len(asks)], args=(f"{index}",)) for index in range(6)
        ]
        for thread in self._threads:
            thread.start()

    def answered(self):
        return sum(end == OK for end in list(self.ends.values()))

    def join(self):
        for thread in self._threads:
            thread.join(START_PATIENCE)
            assert not thread.is_alive(), "a client was never answered"

    def _by_rest(self, name):
        with httpx.Client(timeout=START_PATIENCE, trust_env=False) as client:
            self._ask_rest(name, client.post, PACKED)

    def _by_fresh_rest(self, name):
        with httpx.Client(timeout=START_PATIENCE, trust_env=False) as client:
            self._ask_rest(name, client.post, {**PACKED, "connection": "close"}, watch=client.get)

    def _ask_rest(self, name, post, headers, watch=None):
        number, end, leaving = 0, OK, False
        while end == OK and not (self.heed and leaving):
            number += 1
            contact_id = f"rest-{name}-{number}"
            try:
                answer = post(
                    self._url, params={"contact_id": contact_id}, content=POINTS.tobytes(), headers=headers
                )
                end = {200: OK, 503: REFUSED}.get(answer.status_code, answer.text)
                leaving = answer.headers.get("connection") == "close"
                if watch is not None:  # this one closes each connection itself, so it looks whether it should
                    leaving = self.heed and watch(self._url.replace("v1/recognise", "readyz")).status_code == 503
            except httpx.TransportError:
                end = NO_SERVER
            self.ends[contact_id] = end

    def _by_grpc(self, name):
        with grpc.insecure_channel(self._target) as channel:
            leaving = threading.Event()
            if self.heed:
                threading.Thread(target=_watch, args=(channel, leaving), daemon=True).start()
            number, end = 0, OK
            while end == OK and not leaving.is_set():
                number += 1
                contact_id = f"grpc-{name}-{number}"
                try:
                    ShipshapeStub(channel).Recognise(
                        request(POINTS, contact_id=contact_id), timeout=START_PATIENCE
                    )
                except grpc.RpcError as error:
                    told = "shipshape-error" in dict(error.trailing_metadata() or ())
                    end = REFUSED if told else NO_SERVER if error.code() in CLOSED else str(error)
                self.ends[contact_id] = end


def _watch(channel, leaving):
    for answer in HealthStub(channel).Watch(health_pb2.HealthCheckRequest()):
        if answer.status == health_pb2.HealthCheckResponse.NOT_SERVING:
            leaving.set()
            return


@contextmanager
def serving_slowly(tmp_path, **variables):
    journal = tmp_path / "journal"
    with start("-c", SERVE_SLOWLY, JOURNAL=str(journal), **variables) as process:
        try:
            yield process, *until_ready(process), journal
        finally:
            process.kill()


@pytest.mark.parametrize("seed", range(2))
def test_a_signal_at_a_random_moment_loses_nothing_that_was_accepted(seed, tmp_path):
    with serving_slowly(tmp_path) as (process, rest_port, grpc_port, journal):
        load = Load(rest_port, grpc_port)
        moment = random.Random(seed).randrange(10, 100)
        until(lambda: load.answered() >= moment)
        stopped_by(process, signal.SIGTERM)
        load.join()
        assert set(load.ends.values()) <= {OK, REFUSED, NO_SERVER}
        accepted = set(journal.read_text().split())
        assert len(accepted) >= moment
        assert {load.ends[contact_id] for contact_id in accepted} == {OK}


def test_clients_that_heed_readiness_meet_no_refusal_and_a_second_signal_ends_the_linger(tmp_path):
    with serving_slowly(tmp_path, SHIPSHAPE_LINGER_S="3600") as (process, rest_port, grpc_port, journal):
        load = Load(rest_port, grpc_port, heed=True)
        until(lambda: load.answered() >= 30)
        process.send_signal(signal.SIGTERM)
        load.join()
        with httpx.Client(base_url=f"http://127.0.0.1:{rest_port}", trust_env=False, timeout=PATIENCE) as rest:
            states = [rest.get(path).status_code for path in ("/startedz", "/livez", "/readyz")]
            late = rest.post("/v1/recognise?contact_id=late", content=POINTS.tobytes(), headers=PACKED)
        assert states == [200, 200, 503]
        assert (late.status_code, late.headers["connection"]) == (200, "close")
        stopped_by(process, signal.SIGTERM)
        assert set(load.ends.values()) == {OK}
        assert len(journal.read_text().split()) == len(load.ends) + 1


def test_the_linger_ends_by_itself(tmp_path):
    with serving_slowly(tmp_path, SHIPSHAPE_LINGER_S="0.1") as (process, *_):
        stopped_by(process, signal.SIGTERM)
