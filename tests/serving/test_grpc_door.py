import grpc
import numpy as np
import pytest
from grpc_health.v1 import health_pb2
from grpc_health.v1.health_pb2_grpc import HealthStub
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase

from serving.fakes import DESCRIPTORS, DIGEST, PATIENCE, PNG, SECRET, cluster, image_methods, request, running
from shipshape.serving.grpc.convert import IMAGE_METHODS
from shipshape.v1 import shipshape_pb2 as pb

POINTS = cluster()
SERVICE = "shipshape.v1.Shipshape"
SERVING, NOT_SERVING = health_pb2.HealthCheckResponse.SERVING, health_pb2.HealthCheckResponse.NOT_SERVING


def refusal(call):
    with pytest.raises(grpc.RpcError) as caught:
        call()
    return caught.value


def trailing(call):
    return dict(call.trailing_metadata())


def test_one_contact(doors):
    response, call = doors.ask_grpc(POINTS, contact_id="c7", own_true_heading_deg=370)
    found = response.recognition
    assert (found.contact_id, found.vessel, found.probability) == ("c7", "tug", 0.75)
    assert {each.name: each.probability for each in found.probabilities} == {
        "tug": 0.75,
        "rhib": 0.125,
        "unknown": 0.125,
    }
    assert (found.heading, found.heading_std, found.bow_probability) == (0.5, 0.0625, 0.875)
    assert (found.aspect_deg, found.true_heading_deg) == (30, 10)
    assert list(found.reasons) == [pb.REASON_FEW_POINTS, pb.REASON_END_ON]
    assert (found.box.center.x, found.box.length, found.box.beam, found.box.height) == (40, 20, 8, 10)
    assert (found.measured_points, found.inferred_points) == (40, 40)
    assert np.allclose([[p.x, p.y, p.z] for p in found.keypoints], POINTS[:3])
    assert (found.rung, found.preset, found.image_method) == ("full", pb.PRESET_BEST, 0)
    assert found.bundle == DIGEST
    assert [stage.stage for stage in found.stages] == ["prior", "heading"]
    assert not any(found.HasField(name) for name in ("restored", "images", "rendered_png"))
    assert trailing(call)["server-timing"].startswith("prior;dur=")


def test_no_own_heading_no_true_heading(doors):
    response, _ = doors.ask_grpc(POINTS)
    assert not response.recognition.HasField("true_heading_deg")


def test_what_is_wished_for_is_in_the_answer(doors):
    wishes = pb.Options(include_restored=True, include_images=True, include_png=True)
    found = doors.ask_grpc(POINTS, wishes)[0].recognition
    assert np.array_equal(np.frombuffer(found.restored.points, "<f4").reshape(-1, 3)[:40], POINTS)
    assert found.restored.measured == b"\1" * 40 + b"\0" * 40
    assert (found.images.before.rows, found.images.before.columns, found.images.before.channels) == (64, 64, 3)
    assert found.images.before.values[:4] == bytes([0, 1, 2, 3])
    assert found.images.after.values[:4] == bytes([255, 254, 253, 252])
    assert [(one.rows, one.columns, one.channels) for one in found.descriptors] == [(16, 32, 5)] * 3
    described = [np.frombuffer(one.values, np.uint8).reshape(16, 32, 5) for one in found.descriptors]
    assert np.array_equal(np.moveaxis(np.stack(described), -1, 1), DESCRIPTORS)
    assert found.rendered_png == PNG


@pytest.mark.parametrize("method", image_methods())
def test_preset_and_image_method_reach_the_pipeline(doors, method):
    (number,) = [number for number, known in IMAGE_METHODS.items() if known is method]
    found = doors.ask_grpc(POINTS, pb.Options(preset=pb.PRESET_PAPER, image_method=number))[0].recognition
    assert (found.preset, found.image_method) == (pb.PRESET_PAPER, number)


def test_scan_keeps_order_and_a_bad_contact_to_itself(doors):
    packed = POINTS.astype("<f4").tobytes()
    contacts = [
        pb.Contact(contact_id="good", points=packed),
        pb.Contact(contact_id="few", points=packed[:36]),
        pb.Contact(contact_id="torn", points=packed[:-1]),
        pb.Contact(contact_id="crash", points=packed),
        pb.Contact(contact_id="last", points=packed),
    ]
    response, call = doors.stub.RecogniseScan.with_call(
        pb.RecogniseScanRequest(contacts=contacts), timeout=PATIENCE
    )
    assert [each.contact_id for each in response.results] == ["good", "few", "torn", "crash", "last"]
    assert [each.error.kind for each in response.results] == [
        0,
        pb.ERROR_KIND_UNPROCESSABLE,
        pb.ERROR_KIND_INVALID_INPUT,
        pb.ERROR_KIND_INTERNAL,
        0,
    ]
    assert SECRET not in str(response)
    assert "heading;dur=" in trailing(call)["server-timing"]


def test_model_info(doors):
    info = doors.stub.GetModelInfo(pb.GetModelInfoRequest(), timeout=PATIENCE)
    assert (info.bundle_name, info.bundle) == ("fake", DIGEST)
    assert [(vessel.name, vessel.length) for vessel in info.catalogue] == [("tug", 20), ("rhib", 9)]
    assert dict(info.scores) == {"p.accuracy": 0.99}
    assert list(info.stages) == ["prior", "heading"]
    assert info.limits.max_contacts == 256
    assert info.limits.budget_ms == 50


def test_request_id_comes_back_with_an_answer_and_with_an_error(doors):
    given = (("x-request-id", "voyage-7"),)
    _, call = doors.stub.Recognise.with_call(request(POINTS), metadata=given, timeout=PATIENCE)
    assert trailing(call)["x-request-id"] == "voyage-7"
    error = refusal(lambda: doors.stub.Recognise(request(POINTS[:3]), metadata=given, timeout=PATIENCE))
    assert trailing(error)["x-request-id"] == "voyage-7"


def test_bytes_that_are_no_message(doors):
    call = doors.channel.unary_unary(f"/{SERVICE}/Recognise")
    error = refusal(lambda: call(b"\xff\xff\xff", timeout=PATIENCE))
    assert error.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert error.details() == "expected a message of shipshape.v1, got 3 bytes that do not parse as one"


def test_an_internal_error_tells_an_id_and_logs_the_rest(doors, caplog):
    error = refusal(lambda: doors.ask_grpc(POINTS, contact_id="crash"))
    assert error.code() is grpc.StatusCode.INTERNAL
    assert SECRET not in error.details()
    incident = error.details().rpartition(" ")[2]
    (record,) = [record for record in caplog.records if incident in record.getMessage()]
    assert SECRET in str(record.exc_info[1])


def test_health_follows_readiness():
    with running(opened=False) as doors:
        health = HealthStub(doors.channel)
        for name in ("", SERVICE):
            check = health_pb2.HealthCheckRequest(service=name)
            assert health.Check(check, timeout=PATIENCE).status == NOT_SERVING
        error = refusal(lambda: doors.ask_grpc(POINTS))
        assert error.code() is grpc.StatusCode.UNAVAILABLE


def test_health_can_be_watched(doors):
    health = HealthStub(doors.channel)
    watch = health.Watch(health_pb2.HealthCheckRequest(service=SERVICE), timeout=PATIENCE)
    assert next(watch).status == SERVING
    watch.cancel()


def test_reflection_tells_the_contract(doors):
    database = ProtoReflectionDescriptorDatabase(doors.channel)
    assert {SERVICE, "grpc.health.v1.Health"} <= set(database.get_services())
    assert database.FindFileContainingSymbol(SERVICE).package == "shipshape.v1"


def test_a_second_service_cannot_share_the_port(doors):
    with pytest.raises(OSError, match="gRPC"), running(grpc_port=doors.addresses.grpc_port):
        pass
    with pytest.raises(OSError, match="REST"), running(rest_port=doors.addresses.rest_port):
        pass
