"""The Open Inference Protocol v2 over gRPC, its inputs raw; tensors as in `oip`."""

import itertools
import struct
from collections.abc import Iterator

import grpc
import numpy as np

from shipshape.inference import open_inference_pb2 as pb
from shipshape.inference.open_inference_pb2_grpc import GRPCInferenceServiceStub
from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Outcome, Reply
from shipshape.loadtest.targets.address import Address
from shipshape.loadtest.targets.channels import Channels, of_failure
from shipshape.loadtest.targets.oip import model_of, of_outputs
from shipshape.loadtest.targets.target import CONNECT_S, TargetInfo

INFER = "/inference.GRPCInferenceService/ModelInfer"
LENGTH = struct.Struct("<I")  # before each text of a raw tensor


class OipGrpcTarget:
    """ModelInfer, on several connections in turn."""

    def __init__(self, address: Address) -> None:
        self._model = model_of(address)
        self._channels = Channels(address)

    async def open(self) -> TargetInfo:
        """As `Target.open`."""
        info = await self._channels.open("the Open Inference Protocol", self._describe)
        decode = pb.ModelInferResponse.FromString
        self._calls = itertools.cycle([channel.unary_unary(INFER, None, decode) for channel in self._channels.all])
        return info

    def encode(self, request: Request) -> bytes:
        """As `Target.encode`."""
        counts = [len(cluster) for cluster in request.clusters]
        message = pb.ModelInferRequest(model_name=self._model)
        message.inputs.add(name="points", datatype="FP32", shape=[sum(counts), 3])
        message.inputs.add(name="counts", datatype="INT32", shape=[len(counts)])
        message.raw_input_contents.append(np.concatenate(request.clusters).astype("<f4").tobytes())
        message.raw_input_contents.append(np.array(counts, "<i4").tobytes())
        return message.SerializeToString()

    async def send(self, payload: bytes, deadline_s: float) -> Reply:
        """As `Target.send`."""
        try:
            answer = await next(self._calls)(payload, timeout=deadline_s, metadata=self._channels.metadata)
            return of_outputs({name: _texts(answer, name) for name in ("rung", "error", "detail")})
        except grpc.aio.AioRpcError as error:
            return of_failure(error)
        except (ValueError, LookupError, struct.error) as error:
            return Reply(Outcome.ERROR, f"expected an answer of the protocol, got another: {error}")

    async def close(self) -> None:
        """As `Target.close`."""
        await self._channels.close()

    async def _describe(self, channel: grpc.aio.Channel) -> TargetInfo:
        ask = GRPCInferenceServiceStub(channel).ModelMetadata  # type: ignore[no-untyped-call]
        request = pb.ModelMetadataRequest(name=self._model)
        model = await ask(request, timeout=CONNECT_S, metadata=self._channels.metadata)
        return TargetInfo(version=model.platform, bundle_name=model.versions[-1] if model.versions else "")


def _texts(answer: pb.ModelInferResponse, name: str) -> list[str]:
    """Those of an output; none where the server has no such output."""
    for index, output in enumerate(answer.outputs):
        if output.name == name:
            raw = answer.raw_output_contents
            texts = _from_raw(raw[index]) if raw else output.contents.bytes_contents
            return [text.decode() for text in texts]
    return []


def _from_raw(raw: bytes) -> Iterator[bytes]:
    start = 0
    while start < len(raw):
        (length,) = LENGTH.unpack_from(raw, start)
        start += LENGTH.size + length
        if start > len(raw):
            raise ValueError(f"a text of {length} bytes that is cut off")
        yield raw[start - length : start]
