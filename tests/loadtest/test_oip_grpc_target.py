"""The Open Inference Protocol over gRPC: what a peer is sent, and how its answers count."""

import struct
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import grpc
import numpy as np
import pytest

from loadtest.test_targets import ONE, PATIENCE_S, THREE, opened, run
from shipshape.inference import open_inference_pb2 as pb
from shipshape.inference.open_inference_pb2_grpc import (
    GRPCInferenceServiceServicer,
    add_GRPCInferenceServiceServicer_to_server,
)
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.targets.target import TargetError


class Peer(GRPCInferenceServiceServicer):
    """Answers as it is told, and keeps what it was asked."""

    def __init__(self, answer):
        self.answer, self.asked, self.seconds, self.metadata = answer, [], [], []

    def ModelMetadata(self, request, context):
        if request.name != "m":
            context.abort(grpc.StatusCode.NOT_FOUND, "expected m")
        return pb.ModelMetadataResponse(name="m", versions=["3"], platform="peer")

    def ModelInfer(self, request, context):
        self.asked.append(request)
        self.seconds.append(context.time_remaining())
        self.metadata.append(dict(context.invocation_metadata()))
        if isinstance(self.answer, grpc.StatusCode):
            context.abort(self.answer, "come back later")
        return self.answer


@contextmanager
def serving(peer):
    server = grpc.server(ThreadPoolExecutor(2))
    add_GRPCInferenceServiceServicer_to_server(peer, server)
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    try:
        yield f"oip+grpc://127.0.0.1:{port}/m"
    finally:
        server.stop(None).wait()


async def asked(url, request, deadline_s=PATIENCE_S, **keys):
    async with opened(url, **keys) as (target, info):
        return info, await target.send(target.encode(request), deadline_s)


def raw(**outputs):
    """An answer whose texts are raw, a length before each."""
    answer = pb.ModelInferResponse()
    for name, texts in outputs.items():
        answer.outputs.add(name=name, datatype="BYTES", shape=[len(texts)])
        answer.raw_output_contents.append(b"".join(struct.pack("<I", len(text)) + text for text in texts))
    return answer


def listed(**outputs):
    """An answer whose texts stand in the contents of its tensors."""
    answer = pb.ModelInferResponse()
    for name, texts in outputs.items():
        answer.outputs.add(name=name, datatype="BYTES", shape=[len(texts)]).contents.bytes_contents.extend(texts)
    return answer


BROKEN = raw(rung=[b"full"])
BROKEN.raw_output_contents[0] = b"\1"
SHORT = raw(rung=[b"full"])
SHORT.raw_output_contents[0] = b"\5\0\0\0full"
MISSING = raw(vessel=[b"tug"], rung=[b"full"])
del MISSING.raw_output_contents[1]


@pytest.mark.parametrize(
    ("answer", "outcome"),
    [
        (raw(rung=[b"full"]), Outcome.OK),
        (listed(rung=[b"full"]), Outcome.OK),
        (raw(vessel=[b"tug"]), Outcome.OK),
        (listed(vessel=[b"tug"], rung=[b"full", b"heading_and_box"]), Outcome.DEGRADED),
        (raw(rung=[b"full", b""], error=[b"", b"deadline_exceeded"], detail=[b"", b"late"]), Outcome.EXPIRED),
        (listed(error=[b"unprocessable"], detail=[b"expected points"]), Outcome.ERROR),
        (listed(error=[b"internal"], detail=[]), Outcome.ERROR),
        (listed(rung=[b"\xff"]), Outcome.ERROR),
        (BROKEN, Outcome.ERROR),
        (SHORT, Outcome.ERROR),
        (MISSING, Outcome.ERROR),
        (grpc.StatusCode.RESOURCE_EXHAUSTED, Outcome.REFUSED),
        (grpc.StatusCode.UNAVAILABLE, Outcome.UNAVAILABLE),
        (grpc.StatusCode.INTERNAL, Outcome.ERROR),
    ],
)
def test_an_answer_counts_as(answer, outcome):
    with serving(Peer(answer)) as url:
        _, reply = run(asked(url, ONE))
    assert reply.outcome is outcome
    assert bool(reply.detail) is not outcome.answered


def test_ragged_clusters_are_two_raw_tensors_and_the_token_and_deadline_go_along():
    peer = Peer(raw(rung=[b"full"] * 3))
    with serving(peer) as url:
        info, _ = run(asked(url, THREE, 0.25, token="secret"))
    (request,) = peer.asked
    points, counts = request.inputs
    assert (points.name, points.datatype, list(points.shape)) == ("points", "FP32", [110, 3])
    assert (counts.name, counts.datatype, list(counts.shape)) == ("counts", "INT32", [3])
    sent, sizes = request.raw_input_contents
    assert np.array_equal(np.frombuffer(sent, "<f4").reshape(-1, 3), np.concatenate(THREE.clusters))
    assert np.frombuffer(sizes, "<i4").tolist() == [40, 60, 10]
    assert 0 < peer.seconds[0] < 0.3  # the default would be 10
    assert peer.metadata[0]["authorization"] == "Bearer secret"
    assert (info.version, info.bundle_name) == ("peer", "3")


def test_a_model_that_is_not_there_cannot_be_tested():
    with (
        serving(Peer(raw())) as url,
        pytest.raises(TargetError, match=r"^expected the Open Inference Protocol at oip\+grpc://.* got NOT_FOUND"),
    ):
        run(asked(url.removesuffix("m") + "n", ONE))
