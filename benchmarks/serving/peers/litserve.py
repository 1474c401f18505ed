"""LitServe: a worker process a core, JSON, which is all that its requests can be beside forms."""

import litserve
import numpy as np

from benchmarks.serving.peers.recognise import CORES, HOST, PORT, load, recognise


class Recogniser(litserve.LitAPI):
    """JSON in, JSON out."""

    def setup(self, device: str) -> None:
        """Once a worker."""
        self.pipeline = load()

    def decode_request(self, request: dict) -> np.ndarray:
        """The points."""
        return np.array(request["points"], np.float32)

    def predict(self, points_level: np.ndarray) -> dict:
        """One contact."""
        return recognise(self.pipeline, points_level)

    def encode_response(self, answer: dict) -> dict:
        """The answer as it is."""
        return answer


if __name__ == "__main__":
    server = litserve.LitServer(Recogniser(), accelerator="cpu", workers_per_device=CORES)
    server.run(host=HOST, port=PORT, generate_client_file=False, log_level="warning")
