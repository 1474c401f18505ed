"""Bodies that are small on the wire and huge in memory: none is unpacked beyond the limits, on any door."""

import gzip
import io
import zlib

import grpc
import numpy as np
import pytest

from faults.live import PACKED, PATIENCE, POINTS
from oip.wire import INFER, message
from serving.fakes import request
from shipshape.v1 import shipshape_pb2 as pb

BOMB = bytes(64 * 2**20)  # a thousandth of it on the wire
UNPACKED_MB = 40.0  # that may be held for a moment: twice the largest message that is read
CONTACT = pb.Contact(points=POINTS.tobytes())
UNARY = {
    "/shipshape.v1.Shipshape/Recognise": request(POINTS),
    "/shipshape.v1.Shipshape/RecogniseScan": pb.RecogniseScanRequest(contacts=[CONTACT]),
    "/inference.GRPCInferenceService/ModelInfer": message({"points": POINTS}),
}
STREAM = "/shipshape.v1.Shipshape/RecogniseStream"
GOOD_MESSAGE = pb.RecogniseStreamRequest(sequence=1, contacts=[CONTACT]).SerializeToString()
codings = pytest.mark.parametrize("coding", [grpc.Compression.Gzip, grpc.Compression.Deflate])


@codings
@pytest.mark.parametrize("method", UNARY)
def test_a_compressed_message_counts_by_what_it_unpacks_to(service, method, coding):
    with service.survives():
        call = service.channel.unary_unary(method)
        assert call(UNARY[method].SerializeToString(), timeout=PATIENCE, compression=coding), (
            "compressed is no fault"
        )
        service.forget_most()
        before = service.most_mb()
        with pytest.raises(grpc.RpcError) as caught:
            call(BOMB, timeout=PATIENCE, compression=coding)
        assert caught.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        assert service.most_mb() - before < UNPACKED_MB


@codings
def test_a_compressed_message_ends_its_stream_alone(service, coding):
    with service.survives():
        service.forget_most()
        before = service.most_mb()
        answers = service.channel.stream_stream(STREAM)(
            iter([GOOD_MESSAGE, BOMB]), timeout=PATIENCE, compression=coding
        )
        with pytest.raises(grpc.RpcError) as caught:
            list(answers)
        assert caught.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        assert service.most_mb() - before < UNPACKED_MB


@pytest.mark.parametrize("path", ["/v1/recognise", "/v1/scan?counts=40", INFER])
@pytest.mark.parametrize("coding", ["gzip", "deflate", "br", "zstd", "gzip, gzip"])
def test_rest_refuses_compressed_bodies_before_they_are_read(service, path, coding):
    pack = {"gzip": gzip.compress, "deflate": zlib.compress}.get(coding, lambda content: content[:1000])
    with service.survives():
        answer = service.rest.post(path, content=pack(BOMB), headers=PACKED | {"content-encoding": coding})
        assert (answer.status_code, answer.json()["detail" if path != INFER else "error"]) == (
            415,
            f"expected a body without content encoding, got {coding}",
        )


def packed_npz():
    stream = io.BytesIO()
    np.savez_compressed(stream, points=np.zeros((5_000_000, 3), np.float32))
    return stream.getvalue()


@pytest.mark.parametrize(
    ("kind", "content", "status"),
    [
        ("image/png", b"\x89PNG\r\n\x1a\n" + bytes(100), 415),
        ("application/zip", packed_npz(), 415),
        ("application/x-npy", packed_npz(), 400),
        ("application/octet-stream", packed_npz(), 400),
    ],
    ids=["a picture", "an archive", "an archive as an array", "an archive as points"],
)
def test_forms_that_hold_compressed_data_are_not_read(service, kind, content, status):
    with service.survives():
        answer = service.rest.post("/v1/recognise", content=content, headers={"content-type": kind})
        assert answer.status_code == status


SIZE = 8 * 2**20
JSON_BOMBS = {
    "deep": b"[" * SIZE,
    "deep inside": b'{"points":' + b"[" * SIZE,
    "many lists": b'{"points":[' + b"[]," * (SIZE // 3) + b"[]]}",
    "many contacts": b'{"contacts":[' + b"{}," * (SIZE // 3) + b"{}]}",
    "a long number": b'{"points":[' + b"9" * SIZE + b"]}",
    "many keys": b"{" + b",".join(b'"%x":0' % index for index in range(SIZE // 16)) + b"}",
}


@pytest.mark.parametrize("name", JSON_BOMBS)
@pytest.mark.parametrize("path", ["/v1/recognise", "/v1/scan"])
def test_json_that_is_many_times_larger_in_memory_stays_out_of_the_service(service, path, name):
    with service.survives(grows_mb=300):  # that of the process that parses it included
        service.forget_most()
        before = service.most_mb()
        answer = service.rest.post(path, content=JSON_BOMBS[name], headers={"content-type": "application/json"})
        assert answer.status_code in (400, 413)
        assert service.most_mb() - before < 8 * SIZE / 2**20


def test_the_same_over_oip(service):
    service.forget_most()
    before = service.most_mb()
    answer = service.rest.post(INFER, content=JSON_BOMBS["many lists"])
    assert answer.status_code == 400
    assert service.most_mb() - before < 8 * SIZE / 2**20
