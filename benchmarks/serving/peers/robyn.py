"""Robyn: a process a core (`--processes`), one worker thread each, packed points."""

from robyn import Request, Robyn

from benchmarks.serving.peers.recognise import HOST, PORT, from_bytes, load, recognise

app = Robyn(__file__)
pipeline = load()


@app.post("/recognise")
def answer(request: Request) -> dict:
    """Packed points in, JSON out."""
    return recognise(pipeline, from_bytes(request.body))


if __name__ == "__main__":
    app.start(host=HOST, port=PORT)
