"""The Open Inference Protocol answers and refuses as the typed doors do, number for number and word for word."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from oip import wire
from serving.fakes import PATIENCE, cluster, request
from shipshape.serving.faults import FaultKind
from shipshape.serving.grpc.guard import STATUS as GRPC_STATUS
from shipshape.serving.oip.parameters import PARAMETERS
from shipshape.serving.rest.problems import STATUS as REST_STATUS
from shipshape.serving.rest.schemas import OptionsFields
from shipshape.types import ImageMethod, Preset
from shipshape.v1 import shipshape_pb2 as pb

ROOT = Path(__file__).parents[2]
INCIDENT = re.compile(r"[0-9a-f]{12}$")
GOOD = cluster()
NUMBERS = ("probability", "heading", "heading_std", "bow_probability", "aspect_deg")
quickly = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def contacts():
    """The example scan: arrays (n, 3)."""
    saved = np.load(ROOT / "examples/contacts.npz", allow_pickle=False)
    return np.split(saved["points"].astype(np.float32), np.cumsum(saved["n"])[:-1])


def typed_grpc(doors, points, **fields):
    """The answer of shipshape.v1 over gRPC, under the names of the protocol's outputs."""
    wishes = pb.Options(include_restored=True, **fields)
    found = doors.stub.Recognise(request(points, wishes), timeout=PATIENCE).recognition
    box = found.box
    return {
        **{name: getattr(found, name) for name in NUMBERS},
        "vessel": found.vessel,
        "unknown": found.unknown,
        "rung": found.rung,
        "reasons": ",".join(pb.Reason.Name(number).removeprefix("REASON_").lower() for number in found.reasons),
        "probabilities": [each.probability for each in found.probabilities],
        "box": [box.center.x, box.center.y, box.center.z, box.length, box.beam, box.height],
        "restored_points": np.frombuffer(found.restored.points, "<f4").reshape(-1, 3).tolist(),
        "restored_measured": [bool(byte) for byte in found.restored.measured],
    }


def typed_rest(doors, points, **fields):
    """The answer of /v1/recognise, under the names of the protocol's outputs."""
    found = doors.rest.post(
        "/v1/recognise",
        params={"include_restored": True, **fields},
        content=points.tobytes(),
        headers={"content-type": "application/octet-stream"},
    ).json()
    box = found["box"]
    return {
        **{name: found[name] for name in (*NUMBERS, "vessel", "unknown", "rung")},
        "reasons": ",".join(found["reasons"]),
        "probabilities": list(found["probabilities"].values()),
        "box": [*box["center"], box["length"], box["beam"], box["height"]],
        "restored_points": np.float32(found["restored"]["points"]).tolist(),
        "restored_measured": found["restored"]["measured"],
    }


def row(outputs, index):
    """A contact's row of the outputs, in the same form."""
    ends = np.cumsum(outputs["restored_counts"])
    own = slice(ends[index] - outputs["restored_counts"][index], ends[index])
    found = {"restored_points": outputs["restored_points"][own].tolist()}
    found["restored_measured"] = outputs["restored_measured"][own].tolist()
    for name in ("vessel", "reasons", "rung"):
        found[name] = outputs[name][index]
    for name in (*NUMBERS, "unknown", "probabilities", "box"):
        found[name] = outputs[name][index].tolist()
    return found


@pytest.mark.parametrize("options", [("best", "full_side"), ("paper", "z_top")])
def test_numbers_are_the_same_to_the_last_bit(real, contacts, options):
    """Of the shipped bundle, alone and in a scan, through every form."""
    preset, method = options
    parameters = {"preset": preset, "image_method": method}
    numbers = {
        "preset": f"PRESET_{Preset(preset).name}",
        "image_method": f"IMAGE_METHOD_{ImageMethod(method).name}",
    }
    expected = [typed_grpc(real, points, **numbers) for points in contacts]
    assert [typed_rest(real, points, **parameters) for points in contacts] == expected
    assert len({each["heading"] for each in expected}) == len(contacts)
    names = [*expected[0], "restored_counts"]
    for form in wire.FORMS.values():
        outputs = form(real, wire.scan(*contacts), names, parameters).outputs
        assert [row(outputs, index) for index in range(len(contacts))] == expected
        alone = form(real, {"points": contacts[0]}, names, parameters).outputs
        assert row(alone, 0) == expected[0]


def test_the_columns_of_the_probabilities_are_the_classes(real, contacts):
    classes = real.rest.get("/v2/models/shipshape").json()["properties"]["classes"].split(",")
    found = real.rest.post("/v1/recognise", json={"points": contacts[0].astype(float).tolist()}).json()
    assert list(found["probabilities"]) == classes


def by_v1(doors, points, **beside):
    """Kind and words of the typed doors, which agree."""
    call = doors.stub.Recognise.future(request(points, **beside), timeout=PATIENCE)
    response = doors.rest.post(
        "/v1/recognise",
        params=beside,
        content=points.tobytes(),
        headers={"content-type": "application/octet-stream"},
    )
    if call.exception() is None:
        assert response.status_code == 200
        return "ok", ""
    kind, words = response.json()["error"], INCIDENT.sub("", response.json()["detail"])
    assert (dict(call.trailing_metadata())["shipshape-error"], INCIDENT.sub("", call.details())) == (kind, words)
    return kind, words


def by_oip(doors, form, points, **beside):
    inputs = {
        name: [value.encode()] if name == "contact_id" else np.array([value]) for name, value in beside.items()
    }
    reply = form(doors, {"points": points, **inputs})
    if not reply.error:
        return "ok", ""
    kind = FaultKind(reply.kind)
    assert reply.status in (REST_STATUS[kind], GRPC_STATUS[kind])
    return kind, INCIDENT.sub("", reply.error)


def alone_in_a_scan(doors, form, points, **beside):
    """Kind and words of the second contact of two."""
    inputs = {
        name: [b"", value.encode()] if name == "contact_id" else np.array([math.nan, value])
        for name, value in beside.items()
    }
    outputs = form(doors, wire.scan(GOOD, points, **inputs)).outputs
    assert outputs["error"][0] == ""
    return outputs["error"][1] or "ok", INCIDENT.sub("", outputs["detail"][1])


@quickly
@given(
    points=st.one_of(
        arrays(np.float32, st.tuples(st.integers(0, 20), st.just(3)), elements=st.floats(width=32)),
        st.integers(8, 40).map(lambda count: GOOD[:count]),
        st.floats(0.01, 300).map(lambda factor: GOOD * np.float32(factor)),
    )
)
def test_any_points_meet_the_same_fate(doors, points):
    expected = by_v1(doors, points)
    for form in wire.FORMS.values():
        assert by_oip(doors, form, points) == expected
        assert alone_in_a_scan(doors, form, points) == expected


@pytest.mark.parametrize(
    "beside",
    [
        {"sensor_height_m": 0.0},
        {"sensor_height_m": -3.0},
        {"sensor_height_m": 500.0},
        {"sensor_height_m": 3.0},
        {"own_true_heading_deg": 370.0},
        {"contact_id": "x" * 256},
        {"contact_id": "x" * 257},
        {"contact_id": "crash"},
    ],
    ids=str,
)
def test_what_stands_beside_the_points_meets_the_same_fate(doors, beside):
    expected = by_v1(doors, GOOD, **beside)
    for form in wire.FORMS.values():
        assert by_oip(doors, form, GOOD, **beside) == expected
        assert alone_in_a_scan(doors, form, GOOD, **beside) == expected


def test_a_million_points(doors):
    many = np.zeros((1_000_000, 3), np.float32)
    expected = by_v1(doors, many)
    assert expected[0] == "too_large"
    for form in ("binary", "grpc_raw"):
        assert by_oip(doors, wire.FORMS[form], many) == expected


def test_an_unknown_bundle(doors):
    response = doors.rest.post("/v1/recognise", json={"points": GOOD.astype(float).tolist(), "bundle": "other"})
    for form in wire.FORMS.values():
        reply = form(doors, {"points": GOOD}, parameters={"bundle": "other"})
        assert (reply.kind, reply.error) == (response.json()["error"], response.json()["detail"])


def test_every_option_of_the_typed_doors_is_a_parameter():
    """Except what to put into the answer, which the outputs say."""
    options = {name for name in OptionsFields.model_fields if not name.startswith("include_")}
    assert options == set(PARAMETERS) - {"timeout"}
