"""mosec: one stage with a worker process a core, packed points; its front is Rust."""

from mosec import Server, Worker

from benchmarks.serving.peers.recognise import CORES, from_bytes, load, recognise


class Recogniser(Worker):
    """Bytes in, JSON out."""

    def __init__(self) -> None:
        self.pipeline = load()

    def deserialize(self, data: bytes) -> bytes:
        """The body as it came; mosec would parse JSON."""
        return data

    def forward(self, data: bytes) -> dict:
        """One contact."""
        return recognise(self.pipeline, from_bytes(data))


if __name__ == "__main__":
    server = Server()
    server.append_worker(Recogniser, num=CORES)
    server.run()
