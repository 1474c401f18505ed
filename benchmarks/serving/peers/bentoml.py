"""BentoML: a worker process a core, the body as bytes."""

import bentoml

from benchmarks.serving.peers.recognise import CORES, from_bytes, load, recognise


@bentoml.service(workers=CORES)
class Recogniser:
    """Bytes in, JSON out."""

    def __init__(self) -> None:
        self.pipeline = load()

    @bentoml.api
    def recognise(self, packed: bytes, /) -> dict:
        """One contact."""
        return recognise(self.pipeline, from_bytes(packed))
