"""ONNX Runtime raises, for some contacts only: those get an opaque error, all others their answer."""

import grpc
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from faults.live import PATIENCE, POINTS, eventually, live
from oip.wire import by_grpc_raw, by_json
from serving.bundles import copy_bundle, rewritten
from serving.processes import MODELS
from shipshape.v1 import shipshape_pb2 as pb

pytestmark = pytest.mark.skipif(
    not (MODELS / "manifest.toml").is_file(), reason="models/ has no manifest.toml yet"
)
SERVE = ("-m", "shipshape", "serve")
OPAQUE = "expected an answer, got an internal error; its id in the log is "
SOUND = pb.Contact(contact_id="sound", points=POINTS.tobytes(), sensor_height_m=3.0)
BROKEN = pb.Contact(contact_id="broken", points=POINTS.tobytes())  # of unknown height above the water


def break_for_unknown_heights(network):
    """Let the network look something up that is not there, unless the third feature (water known) is 1."""
    model = onnx.load(network)
    graph, output = model.graph, model.graph.output[0].name
    for node in graph.node:
        node.output[:] = ["unbroken" if name == output else name for name in node.output]
    graph.initializer.extend(
        [
            numpy_helper.from_array(np.array(2), "water"),
            numpy_helper.from_array(np.float32(1000), "thousand"),
            numpy_helper.from_array(np.float32(1), "one"),
            numpy_helper.from_array(np.zeros(1, np.float32), "nothing"),
        ]
    )
    graph.node.extend(
        [
            helper.make_node("Gather", ["features", "water"], ["known"], axis=1),
            helper.make_node("Sub", ["one", "known"], ["unknown"]),
            helper.make_node("Mul", ["unknown", "thousand"], ["beyond"]),
            helper.make_node("Cast", ["beyond"], ["place"], to=TensorProto.INT64),
            helper.make_node("Gather", ["nothing", "place"], ["found"]),
            helper.make_node("ReduceSum", ["found"], ["zero"], keepdims=0),
            helper.make_node("Add", ["unbroken", "zero"], [output]),
        ]
    )
    onnx.checker.check_model(model)
    onnx.save(model, network)


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    """With a bundle whose first network fails for contacts of unknown height above the water."""
    folder = tmp_path_factory.mktemp("onnx")
    bundle = copy_bundle(folder / "bundle")
    break_for_unknown_heights(bundle / "points.onnx")
    rewritten(bundle, name="broken")
    with live(folder, SERVE, BUNDLE=str(bundle)) as service:
        yield service


def test_one_contact_over_each_door(service):
    with service.survives(internal=4):
        answer = service.ask_rest()
        assert (answer.status_code, answer.json()["error"]) == (500, "internal")
        assert answer.json()["detail"].startswith(OPAQUE)
        with pytest.raises(grpc.RpcError) as caught:
            service.stub.Recognise(pb.RecogniseRequest(contact=BROKEN), timeout=PATIENCE)
        assert caught.value.code() is grpc.StatusCode.INTERNAL
        assert caught.value.details().startswith(OPAQUE)
        for infer, status in ((by_json, 500), (by_grpc_raw, grpc.StatusCode.INTERNAL)):
            reply = infer(service, {"points": POINTS})
            assert (reply.status, reply.kind) == (status, "internal")
            assert reply.error.startswith(OPAQUE)


def test_the_others_of_a_scan_are_answered(service):
    with service.survives(internal=16):
        request = pb.RecogniseScanRequest(contacts=[SOUND, BROKEN] * 8)
        results = service.stub.RecogniseScan(request, timeout=PATIENCE).results
        assert [result.error.kind for result in results] == [0, pb.ERROR_KIND_INTERNAL] * 8
        messages = [pb.RecogniseStreamRequest(sequence=n, contacts=[SOUND, BROKEN]) for n in range(8)]
        answers = list(service.stub.RecogniseStream(iter(messages), timeout=PATIENCE))
        assert len(answers) == 8
        for answer in answers:
            sound, broken = answer.results
            assert sound.recognition.contact_id == "sound"
            assert (broken.error.kind, broken.error.message.startswith(OPAQUE)) == (pb.ERROR_KIND_INTERNAL, True)


def test_every_id_that_a_caller_was_told_is_in_the_log_with_the_cause(service):
    with service.survives(internal=1):
        incident = service.ask_rest().json()["detail"].removeprefix(OPAQUE)
        (line,) = eventually(lambda: [line for line in service.internal_errors() if incident in line])
    assert "indices element out of data bounds" in line
