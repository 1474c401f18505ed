"""Bytes that are nearly messages of shipshape.v1: each is answered or refused in a sentence, over every RPC."""

import grpc
from hypothesis import given, settings
from hypothesis import strategies as st

from faults.live import PATIENCE, POINTS
from serving.fakes import request
from shipshape.v1 import shipshape_pb2 as pb

EXAMPLES = 60
SERVICE = "/shipshape.v1.Shipshape/"
CONTACT = pb.Contact(contact_id="a", points=POINTS[:12].tobytes(), sensor_height_m=3.0, own_true_heading_deg=5.0)
OPTIONS = pb.Options(
    preset=pb.PRESET_PAPER,
    image_method=pb.IMAGE_METHOD_Z_TOP,
    bundle="fake",
    include_restored=True,
    lane=pb.LANE_BATCH,
    lowest_rung=pb.RUNG_FULL,
    max_age_ms=1e12,
    captured_at=1.7e9,
)
GOOD = {
    "Recognise": request(POINTS[:12], OPTIONS, contact_id="a", sensor_height_m=3.0),
    "RecogniseScan": pb.RecogniseScanRequest(contacts=[CONTACT] * 3, options=OPTIONS),
    "GetModelInfo": pb.GetModelInfoRequest(),
    "GetCapacity": pb.GetCapacityRequest(points=300, lane=pb.LANE_COLLISION),
}
MESSAGE = pb.RecogniseStreamRequest(sequence=7, contacts=[CONTACT] * 2, options=OPTIONS, timeout_ms=60_000.0)
ENDS = (grpc.StatusCode.OK, grpc.StatusCode.INVALID_ARGUMENT)
LIMITED = (*ENDS, grpc.StatusCode.DEADLINE_EXCEEDED)  # a message may come to say that its points are too old


@st.composite
def torn(draw, content):
    """`content`, of which up to four parts are cut out, doubled, or replaced by other bytes."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(content)))
        end = draw(st.integers(start, min(len(content), start + 24)))
        between = draw(st.binary(max_size=8) | st.just(content[start:end] * 2) | st.just(b"\xff" * 9 + b"\x01"))
        content = content[:start] + between + content[end:]
    return content


def nearly(message):
    return torn(message.SerializeToString()) | st.binary(max_size=100)


def test_every_unary_rpc(service):
    @settings(max_examples=EXAMPLES)
    @given(st.data())
    def ask(data):
        name = data.draw(st.sampled_from(sorted(GOOD)))
        raw = data.draw(nearly(GOOD[name]))
        call = service.channel.unary_unary(SERVICE + name).future(raw, timeout=PATIENCE)
        call.exception(PATIENCE)
        assert call.code() in LIMITED, call.details()
        assert call.code() is grpc.StatusCode.OK or call.details().startswith("expected ")

    with service.survives():
        ask()


def test_messages_of_a_stream(service):
    @settings(max_examples=EXAMPLES)
    @given(st.lists(nearly(MESSAGE), min_size=1, max_size=5))
    def stream(raws):
        good = MESSAGE.SerializeToString()
        call = service.channel.stream_stream(SERVICE + "RecogniseStream")(iter([good, *raws]), timeout=PATIENCE)
        try:
            answers = [pb.RecogniseStreamResponse.FromString(raw) for raw in call]
        except grpc.RpcError:
            answers = None
        assert call.code() in ENDS, call.details()
        if answers is None:
            assert call.details().startswith("expected ")
        else:
            assert len(answers) == 1 + len(raws)
            for answer in answers:
                assert answer.results or answer.error.message.startswith("expected ")

    with service.survives():
        stream()
