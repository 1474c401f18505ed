"""Any bytes get an answer or a sentence, never an internal error."""

import json

import grpc
import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from oip.wire import HEADER, INFER, binary, call, envelope, message, packed, read
from serving.fakes import PATIENCE, cluster

GOOD = {"points": cluster(12), "counts": np.array([12], np.int32), "contact_id": [b"a"]}
BODY, JSON_SIZE = binary(GOOD)
MESSAGE = message(GOOD).SerializeToString()
anything = settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
KINDS = {"invalid_input", "too_large", "unprocessable"}


def is_answered_or_refused(reply):
    assert reply.status in (200, grpc.StatusCode.OK) or reply.kind in KINDS, reply
    assert bool(reply.error) != bool(reply.outputs)


@st.composite
def torn(draw, content):
    """`content` with a part of it replaced by other bytes."""
    start = draw(st.integers(0, len(content)))
    end = draw(st.integers(start, len(content)))
    return content[:start] + draw(st.binary(max_size=8)) + content[end:]


@anything
@given(body=st.binary(max_size=200) | torn(BODY), size=st.integers(0, len(BODY) + 8) | st.just(JSON_SIZE))
def test_bodies_over_rest(doors, body, size):
    is_answered_or_refused(read(doors.rest.post(INFER, content=body, headers={HEADER: str(size)})))


@anything
@given(
    body=values,
    path=st.sampled_from([(), ("inputs",), ("inputs", 0), ("parameters",), ("outputs",), ("id",)]),
    field=st.sampled_from(["name", "shape", "datatype", "data", "parameters", "binary_data_size"]),
)
def test_json_with_any_value_anywhere(doors, body, path, field):
    whole = envelope(GOOD, parameters={"preset": "best"}, outputs=["vessel"], id="1")
    if path == ("inputs", 0):
        whole["inputs"][0][field] = body
    elif path:
        whole[path[0]] = body
    else:
        whole = body
    is_answered_or_refused(read(doors.rest.post(INFER, content=json.dumps(whole).encode())))


@anything
@given(raw=st.binary(max_size=100) | torn(MESSAGE))
def test_messages_over_grpc(doors, raw):
    rpc = doors.channel.unary_unary("/inference.GRPCInferenceService/ModelInfer").future(raw, timeout=PATIENCE)
    codes = (grpc.StatusCode.OK, grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.NOT_FOUND)
    assert rpc.code() in codes, rpc.details()


@anything
@given(contents=st.lists(st.binary(max_size=20) | torn(packed(GOOD["points"])), min_size=3, max_size=3))
def test_raw_contents_over_grpc(doors, contents):
    request = message(GOOD)
    del request.raw_input_contents[:]
    request.raw_input_contents.extend(contents)
    is_answered_or_refused(call(doors, request))
