"""inference.GRPCInferenceService, the Open Inference Protocol: translate, delegate to the core, translate back."""

import grpc

from shipshape.inference import open_inference_pb2 as pb
from shipshape.inference import open_inference_pb2_grpc as pb_grpc
from shipshape.serving.core import Core
from shipshape.serving.grpc import oip_messages
from shipshape.serving.grpc.guard import Guarded, current_call, set_trailing
from shipshape.serving.grpc.servicer import cancel_with, deadline_of, set_timing
from shipshape.serving.health import Health
from shipshape.serving.oip import models
from shipshape.serving.oip.inference import submit
from shipshape.serving.timing import Timeouts
from shipshape.telemetry import INFER, Metrics

SERVICE = pb.DESCRIPTOR.services_by_name["GRPCInferenceService"].full_name
METHODS = {
    "ServerLive": "server_live",
    "ServerReady": "server_ready",
    "ModelReady": "model_ready",
    "ServerMetadata": "server_metadata",
    "ModelMetadata": "model_metadata",
    "ModelInfer": INFER,
}
GUARDED = Guarded(SERVICE, "oip_grpc", METHODS)


class OipServicer(pb_grpc.GRPCInferenceServiceServicer):
    """The methods of the protocol; errors are the guard's matter."""

    def __init__(self, core: Core, metrics: Metrics, timeouts: Timeouts, health: Health) -> None:
        self._core = core
        self._health = health
        self._metrics = metrics
        self._timeouts = timeouts

    def ServerLive(self, request: pb.ServerLiveRequest, context: grpc.ServicerContext) -> pb.ServerLiveResponse:
        """The process answers."""
        set_trailing(context)
        return pb.ServerLiveResponse(live=True)

    def ServerReady(self, request: pb.ServerReadyRequest, context: grpc.ServicerContext) -> pb.ServerReadyResponse:
        """Whether requests should be sent here."""
        set_trailing(context)
        return pb.ServerReadyResponse(ready=self._health.ready)

    def ModelReady(self, request: pb.ModelReadyRequest, context: grpc.ServicerContext) -> pb.ModelReadyResponse:
        """Whether requests for the model should be sent here."""
        models.check_name(request.name)
        ready = self._health.ready
        if ready:
            models.find_model(self._core, request.name, request.version)
        set_trailing(context)
        return pb.ModelReadyResponse(ready=ready)

    def ServerMetadata(
        self, request: pb.ServerMetadataRequest, context: grpc.ServicerContext
    ) -> pb.ServerMetadataResponse:
        """What the server is."""
        set_trailing(context)
        return pb.ServerMetadataResponse(**models.server_metadata())

    def ModelMetadata(
        self, request: pb.ModelMetadataRequest, context: grpc.ServicerContext
    ) -> pb.ModelMetadataResponse:
        """What the model takes and gives."""
        model = models.find_model(self._core, request.name, request.version)
        set_trailing(context)
        return pb.ModelMetadataResponse(**models.model_metadata(model, self._core.limits))

    def ModelInfer(self, request: pb.ModelInferRequest, context: grpc.ServicerContext) -> pb.ModelInferResponse:
        """Contacts of one scan; one that is alone fails as a whole."""
        model = models.find_model(self._core, request.model_name, request.model_version)
        deadline = deadline_of(self._core, self._timeouts, context)
        asked = oip_messages.to_request(request, self._core.limits)
        call = current_call.get()
        inference = submit(self._core, model, asked, deadline, call.outcome, call.share)
        cancel_with(context, inference.tickets)
        tensors, stage_ms = inference.conclude(GUARDED.door, self._metrics, call.outcome)
        set_timing(context, stage_ms, self._core.load())
        response = oip_messages.from_tensors(tensors, raw=bool(request.raw_input_contents))
        response.model_name, response.model_version = models.NAME, models.version_of(model)
        response.id = request.id
        return response
