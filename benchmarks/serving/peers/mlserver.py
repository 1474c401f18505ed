"""MLServer: a worker process a core (`parallel_workers`), Open Inference Protocol over REST and gRPC."""

import asyncio
import json

from mlserver import MLModel, MLServer, ModelSettings, Settings
from mlserver.codecs import NumpyCodec, StringCodec
from mlserver.types import InferenceRequest, InferenceResponse

from benchmarks.serving.peers.recognise import CORES, HOST, PORT, load, recognise


class Recogniser(MLModel):
    """Tensor `points` in, JSON in a string out."""

    async def load(self) -> bool:
        """Once a worker."""
        self.pipeline = load()
        return True

    async def predict(self, payload: InferenceRequest) -> InferenceResponse:
        """One contact."""
        answer = recognise(self.pipeline, NumpyCodec.decode_input(payload.inputs[0]))
        output = StringCodec.encode_output("answer", [json.dumps(answer)])
        return InferenceResponse(model_name=self.name, outputs=[output])


async def serve() -> None:
    """Until it is told to stop."""
    settings = Settings(
        host=HOST, http_port=PORT, grpc_port=PORT + 1, metrics_port=PORT + 2, parallel_workers=CORES, debug=False
    )
    model = ModelSettings(name="recognise", implementation=f"{__spec__.name}.Recogniser")
    await MLServer(settings).start([model])


if __name__ == "__main__":
    asyncio.run(serve())
