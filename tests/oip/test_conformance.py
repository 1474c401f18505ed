"""What the specification of the protocol says of every server, on ours."""

import grpc
import numpy as np
import pytest
from grpc_health.v1 import health_pb2
from grpc_health.v1.health_pb2_grpc import HealthStub
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase

from oip.wire import FORMS, INFER, by_binary, by_json, call, envelope, message, read, scan
from serving.fakes import DIGEST, PATIENCE, cluster, running
from shipshape.inference import open_inference_pb2 as pb
from shipshape.inference.open_inference_pb2_grpc import GRPCInferenceServiceStub
from shipshape.types import ImageMethod, Options, Preset, Rung

POINTS = cluster()
VERSION = DIGEST[:12]
MODEL = "/v2/models/shipshape"
PARAMETERS = {
    "preset": "paper",
    "image_method": "z_top",
    "lowest_rung": "full",
    "lane": "collision",
    "bundle": "fake",
    "captured_at": 1e9,
}
each_form = pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
each_version = pytest.mark.parametrize("version", ["", f"/versions/{VERSION}"])


def stub(doors):
    return GRPCInferenceServiceStub(doors.channel)


def refusal(rpc, request):
    with pytest.raises(grpc.RpcError) as caught:
        rpc(request, timeout=PATIENCE)
    return caught.value


def test_live_and_ready(doors):
    live, ready = doors.rest.get("/v2/health/live"), doors.rest.get("/v2/health/ready")
    assert (live.status_code, live.json()) == (200, {"live": True})
    assert (ready.status_code, ready.json()) == (200, {"live": True, "ready": True})
    assert stub(doors).ServerLive(pb.ServerLiveRequest(), timeout=PATIENCE).live
    assert stub(doors).ServerReady(pb.ServerReadyRequest(), timeout=PATIENCE).ready


def test_live_but_not_ready():
    with running(opened=False) as doors:
        assert doors.rest.get("/v2/health/live").json() == {"live": True}
        for path in ("/v2/health/ready", MODEL, MODEL + "/ready"):
            refused = doors.rest.get(path)
            assert refused.status_code == 503
            assert refused.json()["error"].startswith(("expected a running service", "expected a ready service"))
        assert doors.rest.post(INFER, json=envelope({"points": POINTS})).status_code == 503
        assert stub(doors).ServerLive(pb.ServerLiveRequest(), timeout=PATIENCE).live
        assert not stub(doors).ServerReady(pb.ServerReadyRequest(), timeout=PATIENCE).ready
        assert not stub(doors).ModelReady(pb.ModelReadyRequest(name="shipshape"), timeout=PATIENCE).ready
        assert call(doors, message({"points": POINTS})).status is grpc.StatusCode.UNAVAILABLE


def test_drained_is_not_ready_but_answers():
    with running() as doors:
        doors.service.health.drain()
        for path in ("/v2/health/ready", MODEL + "/ready"):
            refused = doors.rest.get(path)
            assert (refused.status_code, refused.json()["kind"]) == (503, "not_ready")
            assert "drained" in refused.json()["error"]
        assert not stub(doors).ServerReady(pb.ServerReadyRequest(), timeout=PATIENCE).ready
        assert not stub(doors).ModelReady(pb.ModelReadyRequest(name="shipshape"), timeout=PATIENCE).ready
        assert doors.rest.post(INFER, json=envelope({"points": POINTS})).status_code == 200
        doors.service.health.resume()
        assert doors.rest.get("/v2/health/ready").status_code == 200


def test_server_metadata(doors):
    told = doors.rest.get("/v2").json()
    assert set(told) == {"name", "version", "extensions"}
    assert told["name"] == "shipshape"
    assert "binary_tensor_data" in told["extensions"]
    over_grpc = stub(doors).ServerMetadata(pb.ServerMetadataRequest(), timeout=PATIENCE)
    assert [over_grpc.name, over_grpc.version, list(over_grpc.extensions)] == list(told.values())


@each_version
def test_model_metadata(doors, version):
    told = doors.rest.get(MODEL + version).json()
    assert told["name"] == "shipshape"
    assert told["versions"] == [VERSION]
    assert told["platform"] == "onnx_onnxv1"
    inputs = {each["name"]: (each["datatype"], each["shape"]) for each in told["inputs"]}
    assert inputs == {
        "points": ("FP32", [-1, 3]),
        "counts": ("INT32", [-1]),
        "sensor_height_m": ("FP64", [-1]),
        "own_true_heading_deg": ("FP64", [-1]),
        "contact_id": ("BYTES", [-1]),
    }
    assert {each["name"]: each["shape"] for each in told["outputs"]}["probabilities"] == [-1, 3]
    assert told["properties"]["classes"] == "tug,rhib,unknown"
    assert told["properties"]["bundle"] == DIGEST
    request = pb.ModelMetadataRequest(name="shipshape", version=VERSION if version else "")
    over_grpc = stub(doors).ModelMetadata(request, timeout=PATIENCE)
    assert list(over_grpc.versions) == told["versions"]
    assert dict(over_grpc.properties) == told["properties"]
    for mine, theirs in ((over_grpc.inputs, told["inputs"]), (over_grpc.outputs, told["outputs"])):
        listed = [{"name": each.name, "datatype": each.datatype, "shape": list(each.shape)} for each in mine]
        assert listed == theirs


@each_version
def test_model_ready(doors, version):
    told = doors.rest.get(f"{MODEL}{version}/ready")
    assert (told.status_code, told.json()) == (200, {"name": "shipshape", "ready": True})
    request = pb.ModelReadyRequest(name="shipshape", version=VERSION if version else "")
    assert stub(doors).ModelReady(request, timeout=PATIENCE).ready


@pytest.mark.parametrize(("name", "version"), [("other", ""), ("shipshape", "7"), ("", "")])
def test_another_model_or_version_is_not_found(doors, name, version):
    at = f"/v2/models/{name}" + (f"/versions/{version}" if version else "")
    for response in (
        doors.rest.get(at),
        doors.rest.get(at + "/ready"),
        doors.rest.post(at + "/infer", json=envelope({"points": POINTS})),
    ):
        assert response.status_code == 404
        assert response.json()["error"].startswith("expected ")
        assert response.headers["content-type"] == "application/json"
    for error in (
        refusal(stub(doors).ModelReady, pb.ModelReadyRequest(name=name, version=version)),
        refusal(stub(doors).ModelMetadata, pb.ModelMetadataRequest(name=name, version=version)),
        refusal(stub(doors).ModelInfer, message({"points": POINTS}, model_name=name, model_version=version)),
    ):
        assert error.code() is grpc.StatusCode.NOT_FOUND
        assert error.details().startswith("expected ")


@each_form
def test_an_inference(doors, form):
    reply = form(doors, {"points": POINTS, "contact_id": [b"c7"], "own_true_heading_deg": np.array([370.0])})
    outputs = reply.outputs
    assert (reply.fields["model_name"], reply.fields["model_version"]) == ("shipshape", VERSION)
    assert {name: value for name, value in outputs.items() if isinstance(value, list)} == {
        "contact_id": ["c7"],
        "vessel": ["tug"],
        "reasons": ["few_points,end_on"],
        "rung": ["full"],
        "rung_reason": [""],
        "error": [""],
        "detail": [""],
    }
    assert {name: value.tolist() for name, value in outputs.items() if not isinstance(value, list)} == {
        "probability": [0.75],
        "probabilities": [[0.75, 0.125, 0.125]],
        "unknown": [False],
        "heading": [0.5],
        "heading_std": [0.0625],
        "bow_probability": [0.875],
        "aspect_deg": [30.0],
        "true_heading_deg": [10.0],
        "box": [[40.0, 1.5, -2.0, 20.0, 8.0, 10.0]],
    }


@each_form
def test_what_is_not_known_is_nan(doors, form):
    """Also in JSON, which has no NaN: it is null in both directions."""
    nan = np.array([np.nan])
    reply = form(doors, {"points": POINTS, "sensor_height_m": nan, "own_true_heading_deg": nan})
    assert np.isnan(reply.outputs["true_heading_deg"]).all()


@each_form
def test_the_outputs_asked_for_come_in_their_order(doors, form):
    reply = form(doors, {"points": POINTS}, outputs=["heading", "vessel"])
    assert list(reply.outputs) == ["heading", "vessel"]


@each_form
def test_the_optional_id_is_returned(doors, form):
    assert form(doors, {"points": POINTS}, id="42").fields["id"] == "42"
    assert not form(doors, {"points": POINTS}).fields.get("id")


@each_form
def test_parameters_reach_the_pipeline(doors, form):
    seen = []
    begin = doors.pipeline.begin
    doors.pipeline.begin = lambda contact, options: seen.append(options) or begin(contact, options)
    try:
        form(doors, {"points": POINTS}, parameters=PARAMETERS)
    finally:
        doors.pipeline.begin = begin
    assert seen == [Options(Preset.PAPER, ImageMethod.Z_TOP, Rung.FULL)]


@each_form
def test_a_version_can_be_insisted_on(doors, form):
    if form in (by_json, by_binary):
        body = envelope({"points": POINTS})
        assert doors.rest.post(f"{MODEL}/versions/{VERSION}/infer", json=body).status_code == 200
    else:
        assert form(doors, {"points": POINTS}, model_version=VERSION).fields["model_version"] == VERSION


@each_form
def test_a_scan_keeps_order_and_a_bad_contact_to_itself(doors, form):
    ids = [b"good", b"few", b"crash", "høy".encode()]
    reply = form(doors, scan(POINTS, POINTS[:3], POINTS, POINTS, contact_id=ids))
    assert reply.outputs["contact_id"] == ["good", "few", "crash", "høy"]
    assert reply.outputs["vessel"] == ["tug", "", "", "tug"]
    assert reply.outputs["error"] == ["", "unprocessable", "internal", ""]
    assert reply.outputs["detail"][1] == "expected at least 10 points in a cluster, got 3"
    assert np.isnan(reply.outputs["probabilities"]).all(axis=1).tolist() == [False, True, True, False]
    assert reply.outputs["unknown"].tolist() == [False] * 4
    assert "heading;dur=" in reply.headers["server-timing"]


@each_form
def test_restored_clouds_come_when_asked_for(doors, form):
    names = ["restored_points", "restored_measured", "restored_counts", "error"]
    other = cluster(12, seed=1)
    outputs = form(doors, scan(POINTS, POINTS[:2], other), outputs=names).outputs
    assert outputs["restored_counts"].tolist() == [80, 0, 24]
    assert np.array_equal(outputs["restored_points"], np.concatenate([POINTS, -POINTS, other, -other]))
    assert outputs["restored_measured"].tolist() == [True] * 40 + [False] * 40 + [True] * 12 + [False] * 12
    assert outputs["error"] == ["", "unprocessable", ""]


def test_data_may_be_nested_as_its_shape(doors):
    body = envelope({"points": POINTS})
    body["inputs"][0]["data"] = POINTS.tolist()
    assert read(doors.rest.post(INFER, json=body)).outputs["vessel"] == ["tug"]


def test_whole_numbers_are_numbers(doors):
    body = envelope({"points": POINTS, "sensor_height_m": np.array([3.0])})
    body["inputs"][0]["data"] = np.trunc(POINTS).astype(int).tolist()
    body["inputs"][1]["data"] = [3]
    assert read(doors.rest.post(INFER, json=body)).outputs["vessel"] == ["tug"]


def test_each_output_may_be_raw_or_not(doors):
    """Triton's binary tensor data extension: an output's own parameter goes before the request's."""
    body = envelope({"points": POINTS}, parameters={"binary_data_output": True})
    body["outputs"] = [
        {"name": "vessel", "parameters": {"binary_data": False}},
        {"name": "box", "parameters": {"binary_data": True}},
        {"name": "heading"},
    ]
    response = doors.rest.post(INFER, json=body)
    assert response.headers["content-type"] == "application/octet-stream"
    text = response.content[: int(response.headers["inference-header-content-length"])].decode()
    assert '"data":["tug"]' in text
    assert len(response.content) - len(text) == 6 * 8 + 8
    assert read(response).outputs["box"].tolist() == [[40.0, 1.5, -2.0, 20.0, 8.0, 10.0]]


def test_kserves_client_repeats_the_models_name(doors):
    assert by_json(doors, {"points": POINTS}, model_name="shipshape").status == 200
    assert by_json(doors, {"points": POINTS}, model_name="other").status == 400


def test_an_error_is_the_protocols_object_with_what_a_problem_document_says(doors):
    response = doors.rest.post(INFER, json=envelope({"points": POINTS[:3]}), headers={"X-Request-Id": "voyage-7"})
    assert response.headers["content-type"] == "application/json"
    assert response.json() == {
        "error": "expected at least 10 points in a cluster, got 3",
        "type": "urn:shipshape:problem:unprocessable",
        "title": "Unprocessable",
        "status": 422,
        "kind": "unprocessable",
        "request_id": "voyage-7",
    }
    assert response.headers["X-Request-Id"] == "voyage-7"


def test_health_and_reflection_know_the_protocol(doors):
    name = "inference.GRPCInferenceService"
    check = health_pb2.HealthCheckRequest(service=name)
    assert (
        HealthStub(doors.channel).Check(check, timeout=PATIENCE).status == health_pb2.HealthCheckResponse.SERVING
    )
    assert name in ProtoReflectionDescriptorDatabase(doors.channel).get_services()


def test_the_request_id_and_the_times_of_stages_come_back(doors):
    response = doors.rest.post(INFER, json=envelope({"points": POINTS}), headers={"X-Request-Id": "voyage-7"})
    over_grpc = call(doors, message({"points": POINTS}), metadata=(("x-request-id", "voyage-7"),))
    for headers in (response.headers, over_grpc.headers):
        assert headers["server-timing"].startswith("prior;dur=")
        assert headers["x-request-id"] == "voyage-7"
