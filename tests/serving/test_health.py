"""Started, live and ready are three things, and both doors and the health port tell the same."""

import threading
from concurrent.futures import ThreadPoolExecutor

import grpc
import httpx
import pytest
from grpc_health.v1 import health_pb2
from grpc_health.v1.health_pb2_grpc import HealthStub

from serving.fakes import DIGEST, PATIENCE, FakePipeline, cluster, fake_model, request, running, until
from shipshape.serving.grpc.watching import PLACES
from shipshape.serving.health import Health, State

READY, NOT_READY = (True, True, True), (True, True, False)


class Workers:
    alive = True
    sound = True


def told(doors):
    """Started, live, ready as the REST door says; as the gRPC door says, live and ready alone."""
    by_rest = tuple(doors.rest.get(f"/{name}").status_code == 200 for name in ("startedz", "livez", "readyz"))
    check = HealthStub(doors.channel).Check
    by_grpc = [
        check(health_pb2.HealthCheckRequest(service=name), timeout=PATIENCE).status
        == health_pb2.HealthCheckResponse.SERVING
        for name in ("live", "", "shipshape.v1.Shipshape")
    ]
    assert by_grpc == [by_rest[1], by_rest[2], by_rest[2]]
    return by_rest


def test_the_states_in_their_order():
    workers = Workers()
    health = Health(workers)
    changes = []
    health.watch(lambda live, ready: changes.append((live, ready)))

    def seen():
        return health.state, health.started, health.live, health.ready

    assert seen() == (State.STARTING, False, False, False)
    health.move_to(State.WARMING)
    assert seen() == (State.WARMING, True, True, False)
    health.move_to(State.READY)
    assert seen() == (State.READY, True, True, True)
    health.drain()
    assert seen() == (State.DRAINED, True, True, False)
    health.resume()
    health.move_to(State.STOPPING)
    assert seen() == (State.STOPPING, True, True, False)
    assert changes == [(False, False), (True, False), (True, True), (True, False), (True, True), (True, False)]


def test_a_service_drained_before_it_is_warm_does_not_become_ready():
    health = Health(Workers())
    health.move_to(State.WARMING)
    health.drain()
    assert health.state is State.WARMING
    health.move_to(State.READY)
    assert not health.ready


def test_the_death_of_a_worker_is_told_without_being_asked():
    workers = Workers()
    health = Health(workers)
    health.move_to(State.READY)
    changes = []
    health.watch(lambda live, ready: changes.append((live, ready)))
    workers.sound = False
    health.refresh()
    health.refresh()
    assert changes == [(True, True), (True, False)], "one that is stuck may come back"
    workers.alive = False
    health.refresh()
    assert changes[2:] == [(False, False)]
    assert (health.state, health.started, health.live, health.ready) == (State.BROKEN, True, False, False)


def test_warming_ready_and_drained_through_both_doors():
    with running(opened=False) as doors:
        assert told(doors) == NOT_READY
        assert doors.rest.get("/readyz").json()["detail"] == "expected a ready service, got one that is warming"
        doors.service.open(fake_model(FakePipeline()))
        assert told(doors) == READY
        doors.service.health.drain()
        assert told(doors) == NOT_READY
        answer = doors.ask_rest(cluster())
        assert (answer.json()["bundle"], answer.headers["connection"]) == (DIGEST, "close")
        assert doors.ask_grpc(cluster())[0].recognition.bundle == DIGEST
        doors.service.health.resume()
        assert told(doors) == READY
        assert "connection" not in doors.ask_rest(cluster()).headers


def test_leaving_keeps_answering_and_stays_live():
    with running() as doors:
        assert doors.service.leave()
        assert told(doors) == NOT_READY
        assert doors.ask_grpc(cluster())[0].recognition.vessel == "tug"


def test_a_worker_that_dies_ends_life_and_readiness():
    with running(workers=2) as doors:
        doomed = threading.Thread()
        doomed.start()
        doomed.join()
        watch = HealthStub(doors.channel).Watch(health_pb2.HealthCheckRequest(service="live"))
        assert next(watch).status == health_pb2.HealthCheckResponse.SERVING
        doors.ask_grpc(cluster())
        doors.service.executor._threads.hands[0].thread = doomed
        assert next(watch).status == health_pb2.HealthCheckResponse.NOT_SERVING, "nobody had to ask"
        assert told(doors) == (True, False, False)
        assert "shipshape_ready 0.0" in doors.rest.get("/metrics").text


def test_the_health_port_serves_health_and_metrics_alone():
    with running(health_port=0) as doors:
        url = f"http://127.0.0.1:{doors.addresses.health_port}"
        with httpx.Client(base_url=url, timeout=PATIENCE, trust_env=False) as health:
            assert [health.get(path).status_code for path in ("/startedz", "/livez", "/readyz")] == [200] * 3
            assert "shipshape_ready 1.0" in health.get("/metrics").text
            refused = health.get("/v1/model")
            assert (refused.status_code, refused.json()["error"]) == (404, "invalid_input")
            doors.service.health.drain()
            assert health.get("/readyz").status_code == 503
        assert str(doors.addresses).endswith(f", health port {doors.addresses.health_port}")


def test_a_service_that_drains_its_work_is_live_to_the_last_answer():
    with running(health_port=0) as doors:
        held = doors.stub.Recognise.future(request(cluster(), contact_id="hold"), timeout=PATIENCE)
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        stopping = threading.Thread(target=doors.service.stop)
        stopping.start()
        live = f"http://127.0.0.1:{doors.addresses.health_port}/livez"
        until(lambda: doors.service.health.state is State.STOPPING)
        assert httpx.get(live, trust_env=False, timeout=PATIENCE).status_code == 200
        doors.pipeline.release.set()
        assert held.result().recognition.vessel == "tug"
        stopping.join(PATIENCE)
        with pytest.raises(httpx.ConnectError):
            httpx.get(live, trust_env=False, timeout=PATIENCE)


def test_watchers_that_come_and_go_while_the_state_changes_hold_nobody_up():
    """With the servicer of grpc_health as it comes, this stops the door for good."""
    with running() as doors, ThreadPoolExecutor(4) as pool:

        def come_and_go():
            with grpc.insecure_channel(f"127.0.0.1:{doors.addresses.grpc_port}") as channel:
                for _ in range(50):
                    watch = HealthStub(channel).Watch(health_pb2.HealthCheckRequest(), timeout=PATIENCE)
                    next(watch)
                    watch.cancel()

        watching = [pool.submit(come_and_go) for _ in range(4)]
        while not all(each.done() for each in watching):
            doors.service.health.drain()
            doors.service.health.resume()
        for each in watching:
            each.result()
        assert told(doors) == READY


def test_one_watcher_too_many_is_refused_and_its_place_comes_back():
    with running() as doors:
        watch = HealthStub(doors.channel).Watch
        held = [watch(health_pb2.HealthCheckRequest()) for _ in range(PLACES)]
        for each in held:
            next(each)
        refused = watch(health_pb2.HealthCheckRequest(), timeout=PATIENCE)
        assert refused.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        assert refused.details() == f"expected at most {PLACES} watchers at a time, got one more"
        held.pop().cancel()
        until(lambda: _is_taken(watch))
        for each in held:
            each.cancel()


def _is_taken(watch):
    call = watch(health_pb2.HealthCheckRequest(), timeout=PATIENCE)
    try:
        return next(call) is not None
    except grpc.RpcError:
        return False
    finally:
        call.cancel()
