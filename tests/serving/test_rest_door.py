import base64
import json

import cv2
import grpc
import numpy as np
import pytest
from prometheus_client.parser import text_string_to_metric_families

from serving.fakes import DESCRIPTORS, DIGEST, PATIENCE, PNG, SECRET, cluster, image_methods, rows, running
from shipshape.serving.rest.schemas import ModelAnswer, RecognitionAnswer, ScanAnswer
from shipshape.v1 import shipshape_pb2 as pb

POINTS = cluster()
PACKED = {"content-type": "application/octet-stream"}


def test_json_points_are_recognised(doors):
    response = doors.ask_rest(POINTS, contact_id="c7", own_true_heading_deg=370)
    assert response.status_code == 200
    answer = response.json()
    RecognitionAnswer.model_validate(answer)
    assert answer["contact_id"] == "c7"
    assert answer["vessel"] == "tug"
    assert answer["probabilities"] == {"tug": 0.75, "rhib": 0.125, "unknown": 0.125}
    assert answer["box"] == {"center": [40.0, 1.5, -2.0], "length": 20, "beam": 8, "height": 10}
    assert answer["true_heading_deg"] == 10
    assert (answer["measured_points"], answer["inferred_points"]) == (40, 40)
    assert (answer["preset"], answer["image_method"], answer["rung"]) == ("best", None, "full")
    assert answer["bundle"] == DIGEST
    assert not answer.keys() & {"restored", "images", "rendered_png"}


def test_base64_and_packed_bodies_give_the_same_answer(doors):
    packed = POINTS.astype("<f4").tobytes()
    text = base64.b64encode(packed).decode()
    answers = [
        doors.ask_rest(POINTS, contact_id="a", include_restored=True).json(),
        doors.rest.post(
            "/v1/recognise", json={"points_base64": text, "contact_id": "a", "include_restored": True}
        ).json(),
        doors.rest.post("/v1/recognise?contact_id=a&include_restored=true", content=packed, headers=PACKED).json(),
    ]
    for answer in answers:
        del answer["stage_ms"]
    assert answers[0] == answers[1] == answers[2]
    assert np.array_equal(np.float32(answers[0]["restored"]["points"])[:40], POINTS)


def test_what_is_wished_for_is_in_the_answer(doors):
    answer = doors.ask_rest(POINTS, include_restored=True, include_images=True, include_png=True).json()
    RecognitionAnswer.model_validate(answer)
    assert answer["restored"]["measured"] == [True] * 40 + [False] * 40
    before = cv2.imdecode(np.frombuffer(base64.b64decode(answer["images"]["before"]), np.uint8), 1)
    assert before.shape == (64, 64, 3)
    assert before[0, 1].tolist() == [3, 4, 5]
    described = [cv2.imdecode(np.frombuffer(base64.b64decode(one), np.uint8), -1) for one in answer["descriptors"]]
    assert np.array_equal(np.stack(described), DESCRIPTORS.reshape(3, 80, 32))
    assert base64.b64decode(answer["rendered_png"]) == PNG


@pytest.mark.parametrize("method", image_methods())
def test_preset_and_image_method_reach_the_pipeline(doors, method):
    answer = doors.ask_rest(POINTS, preset="paper", image_method=method).json()
    assert (answer["preset"], answer["image_method"]) == ("paper", method)


def test_bundle_insisted_on_by_name_or_digest(doors):
    assert doors.ask_rest(POINTS, bundle="fake").status_code == 200
    assert doors.ask_rest(POINTS, bundle=DIGEST).status_code == 200
    refused = doors.ask_rest(POINTS, bundle="other")
    assert refused.status_code == 400
    assert refused.json()["detail"] == f"expected bundle fake ({DIGEST}), got other"


def test_server_timing_and_request_id(doors):
    response = doors.ask_rest(POINTS, headers={"X-Request-Id": "voyage-7"})
    stages = [entry.partition(";dur=") for entry in response.headers["Server-Timing"].split(", ")]
    assert [name for name, _, _ in stages] == ["prior", "heading"]
    assert all(float(milliseconds) >= 0 for _, _, milliseconds in stages)
    assert response.headers["X-Request-Id"] == "voyage-7"
    assert doors.ask_rest(POINTS, headers={"X-Request-Id": "a b\tc"}).headers["X-Request-Id"] != "a b\tc"


def test_scan_keeps_order_and_a_bad_contact_to_itself(doors):
    contacts = [
        {"contact_id": "good", "points": rows(POINTS)},
        {"contact_id": "few", "points": rows(POINTS[:3])},
        {"contact_id": "flat", "points": [[1, 2]] * 20},
        {"contact_id": "odd", "colour": "red"},
        "no object",
        {"contact_id": "crash", "points": rows(POINTS)},
        {"contact_id": "last", "points": rows(POINTS)},
    ]
    response = doors.rest.post("/v1/scan", json={"contacts": contacts})
    assert response.status_code == 200
    ScanAnswer.model_validate(response.json())
    results = response.json()["results"]
    assert [each["contact_id"] for each in results] == ["good", "few", "flat", "odd", "", "crash", "last"]
    kinds = [each.get("error", {}).get("error") for each in results]
    invalid = "invalid_input"
    assert kinds == [None, "unprocessable", invalid, invalid, invalid, "internal", None]
    assert "prior;dur=" in response.headers["Server-Timing"]


def test_scan_of_bad_contacts_alone_is_answered(doors):
    response = doors.rest.post("/v1/scan", json={"contacts": [{"points": []}]})
    assert response.json()["results"][0]["error"]["error"] == "unprocessable"


def test_model_info(doors):
    info = doors.rest.get("/v1/model").json()
    ModelAnswer.model_validate(info)
    assert (info["bundle_name"], info["bundle"]) == ("fake", DIGEST)
    assert info["catalogue"][0] == {"name": "tug", "length": 20, "beam": 8, "height": 10}
    assert info["scores"] == {"p.accuracy": 0.99}
    assert info["stages"] == ["prior", "heading"]
    assert info["limits"]["max_contacts"] == 256


@pytest.mark.parametrize(
    ("method", "path", "status", "detail"),
    [
        ("GET", "/nowhere", 404, "expected a path that /openapi.json lists, got '/nowhere'"),
        ("GET", "/v1/recognise", 405, "expected POST on /v1/recognise, got GET"),
        ("DELETE", "/livez", 405, "expected GET on /livez, got DELETE"),
    ],
)
def test_the_frameworks_refusals_are_problems_too(doors, method, path, status, detail):
    response = doors.rest.request(method, path)
    assert response.status_code == status
    assert response.headers["content-type"] == "application/problem+json"
    assert response.json()["detail"] == detail


def test_the_frameworks_refusals_have_an_id(doors):
    given = {"X-Request-Id": "voyage-7"}
    for method, path in (("GET", "/nowhere"), ("DELETE", "/livez"), ("POST", "/v1/recognise")):
        response = doors.rest.request(method, path, headers=given)
        assert response.headers["X-Request-Id"] == response.json()["request_id"] == "voyage-7"
        first, second = (doors.rest.request(method, path).json()["request_id"] for _ in range(2))
        assert "" != first != second


def test_another_media_type_is_refused(doors):
    response = doors.rest.post("/v1/recognise", content=b"x", headers={"content-type": "text/csv"})
    assert response.status_code == 415
    assert response.json()["detail"] == (
        "expected a body of type application/json, application/octet-stream, application/x-npy "
        "or application/vnd.shipshape.pointcloud2, got text/csv"
    )
    response = doors.rest.post("/v1/scan", content=b"x")
    assert response.status_code == 415
    assert "type application/json or application/octet-stream, got none" in response.json()["detail"]


def test_a_problem_document_is_complete(doors):
    response = doors.ask_rest(POINTS[:3])
    assert response.headers["content-type"] == "application/problem+json"
    assert response.json() == {
        "type": "urn:shipshape:problem:unprocessable",
        "title": "Unprocessable",
        "status": 422,
        "detail": "expected at least 10 points in a cluster, got 3",
        "error": "unprocessable",
        "request_id": response.headers["X-Request-Id"],
    }


def test_an_internal_error_tells_an_id_and_logs_the_rest(doors, caplog):
    response = doors.ask_rest(POINTS, contact_id="crash")
    assert response.status_code == 500
    assert SECRET not in response.text
    incident = response.json()["detail"].rpartition(" ")[2]
    (record,) = [record for record in caplog.records if incident in record.getMessage()]
    assert SECRET in str(record.exc_info[1])


@pytest.mark.parametrize("text", ["0", "-5", "nan", "soon", "1e99"])
def test_a_senseless_timeout_is_refused(doors, text):
    response = doors.ask_rest(POINTS, headers={"Shipshape-Timeout-Ms": text})
    assert response.status_code == 400
    assert "Shipshape-Timeout-Ms" in response.json()["detail"]


def test_a_body_over_the_limit_is_refused_while_it_is_read():
    with running(max_body_bytes=2048) as doors:
        declared = doors.rest.post("/v1/recognise", content=bytes(12 * 200), headers=PACKED)
        streamed = doors.rest.post("/v1/recognise", content=(bytes(1200) for _ in range(3)), headers=PACKED)
        for response in (declared, streamed):
            assert response.status_code == 413
            assert "expected at most 2048 bytes a request" in response.json()["detail"]
        assert doors.ask_rest(POINTS[:10]).status_code == 200


def test_health_and_readiness_are_two_things():
    with running(opened=False) as doors:
        assert doors.rest.get("/livez").status_code == 200
        assert doors.rest.get("/readyz").status_code == 503
        refused = doors.ask_rest(POINTS)
        assert (refused.status_code, refused.json()["error"]) == (503, "not_ready")
        assert doors.rest.get("/readyz").json()["request_id"] != refused.json()["request_id"] != ""
    assert json.loads(refused.text)["detail"].startswith("expected a running service")


def test_contacts_of_a_scan_that_is_refused_as_a_whole_are_counted():
    contacts = [{"points": rows(POINTS)}] * 3
    with running(max_contacts=2, queue_limit=2) as doors:
        assert doors.rest.post("/v1/scan", json={"contacts": contacts}).status_code == 413
        assert doors.rest.post("/v1/scan", json={"contacts": contacts[:2], "bundle": "other"}).status_code == 400
        with pytest.raises(grpc.RpcError):
            doors.stub.RecogniseScan(pb.RecogniseScanRequest(contacts=[pb.Contact()] * 5), timeout=PATIENCE)
        text = doors.rest.get("/metrics").text
    assert 'shipshape_contacts_total{door="rest",outcome="too_large"} 3.0' in text
    assert 'shipshape_contacts_total{door="rest",outcome="invalid_input"} 2.0' in text
    assert 'shipshape_contacts_total{door="grpc",outcome="too_large"} 5.0' in text


def test_metrics_tell_of_every_outcome():
    with running() as doors:
        doors.ask_rest(POINTS)
        doors.ask_rest(POINTS[:3])
        doors.rest.post("/v1/scan", json={"contacts": [{"points": rows(POINTS)}, {"points": []}]})
        text = doors.rest.get("/metrics").text
    families = {family.name: family for family in text_string_to_metric_families(text)}
    samples = {
        (sample.name, *sorted(sample.labels.items())): sample.value
        for family in families.values()
        for sample in family.samples
    }
    count = "shipshape_request_seconds_count"
    assert samples[count, ("door", "rest"), ("method", "recognise"), ("outcome", "ok")] == 1
    assert samples[count, ("door", "rest"), ("method", "recognise"), ("outcome", "unprocessable")] == 1
    assert samples["shipshape_contacts_total", ("door", "rest"), ("outcome", "ok")] == 2
    assert samples["shipshape_contacts_total", ("door", "rest"), ("outcome", "unprocessable")] == 2
    assert samples["shipshape_stage_seconds_count", ("stage", "heading")] == 2
    assert samples["shipshape_stage_seconds_bucket", ("le", "0.05"), ("stage", "prior")] == 2
    assert samples["shipshape_bundle_info", ("digest", DIGEST), ("name", "fake")] == 1
    assert samples[("shipshape_ready",)] == 1
    assert samples[("shipshape_queue_depth",)] == 0
    assert samples["shipshape_in_flight", ("door", "rest")] == 0
