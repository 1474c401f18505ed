"""Every malformed request is one sentence and INVALID_ARGUMENT or 400, however it is malformed."""

import json
import re

import grpc
import numpy as np
import pytest

from oip.wire import FORMS, HEADER, INFER, binary, call, envelope, message, packed, read, scan
from serving.fakes import cluster
from shipshape.inference import open_inference_pb2 as pb

POINTS = cluster()
GOOD = {"points": POINTS}
TWO = scan(POINTS, POINTS)
HUGE = 2**62
each_form = pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)


def refused(reply, words):
    assert reply.status in (400, grpc.StatusCode.INVALID_ARGUMENT), reply
    assert reply.kind == "invalid_input"
    assert re.fullmatch(r"expected .+, got .+", reply.error, re.S)
    assert words in reply.error


def integers(*values):
    return np.array(values, np.int32)


BAD_INPUTS = {
    "no points": ({"counts": integers(40)}, "expected input points, got none"),
    "an unknown input": (GOOD | {"colour": [b"red"]}, "expected only inputs points, counts"),
    "points of another type": ({"points": POINTS.astype(np.float64)}, "points of datatype FP32, got 'FP64'"),
    "points of two columns": ({"points": POINTS[:, :2]}, "points of shape [-1, 3], got [40, 2]"),
    "points of many dimensions": (
        {"points": POINTS.reshape([1] * 10 + [40, 3])},
        "points of shape [-1, 3], got one of 12 dimensions",
    ),
    "points in one row": ({"points": POINTS.reshape(-1)}, "points of shape [-1, 3], got [120]"),
    "counts of another rank": (GOOD | {"counts": integers([40])}, "counts of shape [-1], got [1, 1]"),
    "counts that are too few": (
        scan(POINTS) | {"counts": integers(39)},
        "that add up to 40 points, got a sum of 39",
    ),
    "counts that overflow": (GOOD | {"counts": integers(*[2**31 - 1] * 3)}, "got a sum of 6442450941"),
    "negative counts": (TWO | {"counts": integers(-1, 81)}, "expected counts of 0 or more, got -1"),
    "no contact": (GOOD | {"counts": integers()}, "contacts in a scan, got none"),
    "heights of some": (TWO | {"sensor_height_m": np.array([3.0])}, "2 elements of input sensor_height_m"),
    "headings of too many": (
        GOOD | {"own_true_heading_deg": np.zeros(2)},
        "expected 1 elements of input own_true",
    ),
    "ids of too many": (GOOD | {"contact_id": [b"a", b"b"]}, "expected 1 elements of input contact_id"),
}


@each_form
@pytest.mark.parametrize("name", BAD_INPUTS)
def test_bad_inputs(doors, form, name):
    inputs, words = BAD_INPUTS[name]
    refused(form(doors, inputs), words)


@each_form
@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"colour": "red"}, "expected only parameters preset, image_method, lowest_rung, lane"),
        ({"preset": "worst"}, "expected parameter preset to be one of paper, best, got 'worst'"),
        ({"preset": 1}, "parameter preset to be one of paper, best, got 1"),
        ({"image_method": True}, "parameter image_method"),
        ({"bundle": "other"}, "expected bundle fake"),
        ({"bundle": 3}, "expected parameter bundle to be a string, got 3"),
        ({"lane": "fast"}, "expected parameter lane to be one of collision, tracking, batch, got 'fast'"),
        ({"lowest_rung": 1}, "expected parameter lowest_rung to be one of full"),
        ({"captured_at": "now"}, "expected parameter captured_at to be a number, got 'now'"),
        ({"max_age_ms": 0}, "expected max_age_ms above 0, got 0"),
        ({"timeout": 0}, "parameter timeout as whole microseconds above 0, got 0"),
        ({"timeout": -1}, "microseconds above 0, got -1"),
        ({"timeout": True}, "microseconds above 0, got True"),
        ({"timeout": 1.5}, "microseconds above 0, got 1.5"),
    ],
)
def test_bad_parameters(doors, form, parameters, words):
    refused(form(doors, GOOD, parameters=parameters), words)


@each_form
@pytest.mark.parametrize(
    ("outputs", "words"),
    [
        (["colour"], "expected only outputs contact_id, vessel"),
        (["vessel", "vessel"], "expected each output once"),
    ],
)
def test_bad_outputs(doors, form, outputs, words):
    refused(form(doors, GOOD, outputs=outputs), words)


def changed(**tensor):
    """A request in JSON whose points say something else."""
    body = envelope(GOOD)
    body["inputs"][0].update(tensor)
    return body


BAD_JSON = {
    "not JSON": (b"points", "expected JSON, got 6 bytes"),
    "not an object": (b"[1, 2]", "expected the body to be"),
    "no inputs": (b"{}", "expected inputs, got none"),
    "inputs as an object": (b'{"inputs": {}}', "expected inputs to be"),
    "an unknown field": (b'{"inputs": [], "colour": 1}', "expected only known fields"),
    "an id that is no text": ({**envelope(GOOD), "id": 42}, "expected id to be a valid string, got 42"),
    "parameters as a list": ({**envelope(GOOD), "parameters": []}, "expected parameters to be"),
    "an input twice": ({"inputs": envelope(GOOD)["inputs"] * 2}, "expected each input once, got points again"),
    "an output as text": ({**envelope(GOOD), "outputs": ["vessel"]}, "expected outputs.0 to be"),
    "no shape": ({"inputs": [{"name": "points", "datatype": "FP32", "data": []}]}, "shape, got none"),
    "a shape of fractions": (
        changed(shape=[40.0, 3]),
        "expected inputs.0.shape.0 to be a valid integer, got 40.0",
    ),
    "a shape of true": (changed(shape=[True, 3]), "expected inputs.0.shape.0 to be a valid integer, got True"),
    "a negative shape": (changed(shape=[-40, 3]), "of shape [-1, 3], got [-40, 3]"),
    "a shape that lies": (changed(shape=[41, 3]), "expected 123 elements of input points, got 120"),
    "a huge shape": (changed(shape=[HUGE, 3]), f"expected {3 * HUGE} elements"),
    "no data": (changed(data=None), "expected data of input points as a list, got None"),
    "data as text": (changed(data="1,2,3"), "expected data of input points as a list, got '1,2,3'"),
    "text among numbers": (changed(data=["1"] * 120), "expected only numbers in data of input points"),
    "true among numbers": (changed(data=[1.0] * 119 + [True]), "expected only numbers in data of input points"),
    "rows of four": (changed(data=[[1, 2, 3, 4]] * 30), "flat or in lists as its shape"),
    "rows of rows": (changed(data=[[[1, 2, 3]]] * 40), "flat or in lists as its shape"),
    "rows and numbers": (changed(data=[[1, 2, 3], 4]), "flat or in lists as its shape"),
    "an unknown tensor parameter": (changed(parameters={"classification": 3}), "parameters binary_data_size here"),
    "shared memory": (changed(parameters={"shared_memory_region": "x"}), "parameters binary_data_size here"),
    "raw data as well": (changed(parameters={"binary_data_size": 0}), "one of data and binary_data_size"),
    "raw data nowhere": (
        changed(data=None, parameters={"binary_data_size": 480}),
        "from 0 to the 0 bytes that are left",
    ),
    "binary_data_output as text": (
        {**envelope(GOOD), "parameters": {"binary_data_output": "yes"}},
        "expected parameter binary_data_output to be true or false, got 'yes'",
    ),
    "binary_data as a number": (
        {**envelope(GOOD), "outputs": [{"name": "vessel", "parameters": {"binary_data": 1}}]},
        "expected parameter binary_data to be true or false, got 1",
    ),
    "a classification asked for": (
        {**envelope(GOOD), "outputs": [{"name": "vessel", "parameters": {"classification": 3}}]},
        "expected only parameters binary_data here, got 'classification'",
    ),
}


@pytest.mark.parametrize("name", BAD_JSON)
def test_malformed_json(doors, name):
    body, words = BAD_JSON[name]
    content = body if isinstance(body, bytes) else json.dumps(body).encode()
    refused(read(doors.rest.post(INFER, content=content)), words)


@pytest.mark.parametrize("count", [2**31, -(2**40), 10**30])
def test_integers_beyond_their_type(doors, count):
    body = envelope(GOOD | {"counts": integers(40)})
    body["inputs"][1]["data"] = [count]
    refused(read(doors.rest.post(INFER, json=body)), "expected integers of 32 bits in input counts")


@pytest.mark.parametrize("size", ["", "-1", "+5", "1e2", "x", "99999", "9" * 30, "²"])
def test_a_header_that_lies_about_the_json(doors, size):
    body, _ = binary(GOOD)
    response = doors.rest.post(INFER, content=body, headers={HEADER: size.encode("latin-1")})
    refused(read(response), f"expected {HEADER} of 0 to")


@pytest.mark.parametrize("shift", [-1, 1, 300])
def test_json_that_ends_elsewhere(doors, shift):
    body, size = binary(GOOD)
    refused(read(doors.rest.post(INFER, content=body, headers={HEADER: str(size + shift)})), "expected JSON")


@pytest.mark.parametrize("size", [-1, 0, 479, 481, HUGE, "480", 480.0, None, True])
def test_sizes_of_raw_data_that_lie(doors, size):
    body, end = binary(GOOD)
    head = json.loads(body[:end])
    head["inputs"][0]["parameters"]["binary_data_size"] = size
    text = json.dumps(head).encode()
    response = doors.rest.post(INFER, content=text + body[end:], headers={HEADER: str(len(text))})
    refused(read(response), "binary_data_size" if size not in (0, 479) else "expected 480 bytes of input points")


def test_bytes_that_belong_to_no_input(doors):
    body, end = binary(GOOD)
    refused(
        read(doors.rest.post(INFER, content=body + b"x", headers={HEADER: str(end)})),
        "expected 480 bytes behind the JSON, as the inputs say, got 481",
    )


BAD_TEXTS = {
    "torn": packed([b"abc"])[:-1],
    "a length that lies": b"\xff\xff\xff\xffabc",
    "no length": b"ab",
    "nothing": b"",
    "one more": packed([b"abc", b"d"]),
    "bytes behind": packed([b"abc"]) + b"x",
}


@pytest.mark.parametrize("name", BAD_TEXTS)
def test_bytes_elements_that_are_not(doors, name):
    request = message(GOOD | {"contact_id": [b"abc"]})
    request.raw_input_contents[1] = BAD_TEXTS[name]
    refused(call(doors, request), "expected 1 elements of input contact_id, each after its length")
    body, end = binary(GOOD | {"contact_id": [b"abc"]})
    head = json.loads(body[:end])
    head["inputs"][1]["parameters"]["binary_data_size"] = len(BAD_TEXTS[name])
    text = json.dumps(head).encode()
    content = text + packed(POINTS) + BAD_TEXTS[name]
    refused(read(doors.rest.post(INFER, content=content, headers={HEADER: str(len(text))})), "contact_id, each")


@pytest.mark.parametrize("form", [FORMS["binary"], FORMS["grpc_raw"], FORMS["grpc_typed"]])
def test_an_id_that_is_no_text(doors, form):
    refused(form(doors, GOOD | {"contact_id": [b"\xff"]}), "expected UTF-8 in input contact_id")


def test_raw_and_typed_contents_at_once(doors):
    both = message(GOOD, raw=False)
    both.raw_input_contents.append(packed(POINTS))
    refused(call(doors, both), "expected one of contents and raw_input_contents of input points, got both")


def test_raw_contents_of_some_inputs(doors):
    request = message(TWO)
    del request.raw_input_contents[1]
    refused(call(doors, request), "expected raw_input_contents of all 2 inputs, got 1")


@pytest.mark.parametrize("shape", [[41, 3], [HUGE, 3]])
def test_a_shape_that_lies_over_grpc(doors, shape):
    for raw in (True, False):
        request = message(GOOD, raw=raw)
        request.inputs[0].shape[:] = shape
        refused(call(doors, request), "of input points, got")


def test_contents_in_another_field(doors):
    request = message(GOOD, raw=False)
    request.inputs[0].contents.fp64_contents.append(1.0)
    refused(call(doors, request), "expected only fp32_contents in contents of input points, got fp32_contents and")


def test_tensor_parameters_over_grpc(doors):
    request = message(GOOD, outputs=["vessel"])
    request.outputs[0].parameters["classification"].int64_param = 3
    refused(call(doors, request), "got 'classification'")
    request = message(GOOD)
    request.inputs[0].parameters["shared_memory_region"].string_param = "x"
    refused(call(doors, request), "got 'shared_memory_region'")
    for raw, size in ((True, 479), (False, 480)):
        request = message(GOOD, raw=raw)
        request.inputs[0].parameters["binary_data_size"].int64_param = size
        refused(
            call(doors, request), f"expected binary_data_size of input points as in raw_input_contents, got {size}"
        )
    request = message(GOOD)
    request.parameters["preset"].CopyFrom(pb.InferParameter())
    refused(call(doors, request), "parameter preset to be one of paper, best, got None")


def test_bytes_that_are_no_message(doors):
    rpc = doors.channel.unary_unary("/inference.GRPCInferenceService/ModelInfer")
    with pytest.raises(grpc.RpcError) as caught:
        rpc(b"\xff\xff\xff", timeout=5)
    assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert caught.value.details() == "expected a message of inference, got 3 bytes that do not parse as one"
