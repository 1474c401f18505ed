"""Plain FastAPI under uvicorn, a process a core (`--workers`): JSON checked by pydantic, or bytes."""

import orjson
from fastapi import FastAPI, Request, Response
from pydantic import BaseModel

from benchmarks.serving.peers.recognise import from_bytes, load, recognise

app = FastAPI()
pipeline = load()


class Body(BaseModel):
    """One contact."""

    points: list[tuple[float, float, float]]


@app.post("/json")
def recognise_json(body: Body) -> dict:
    """Points as JSON; FastAPI runs it in its thread pool."""
    return recognise(pipeline, body.points)


@app.post("/binary")
async def recognise_binary(request: Request) -> Response:
    """Packed points; computed on the loop, the way of least cost."""
    answer = recognise(pipeline, from_bytes(await request.body()))
    return Response(orjson.dumps(answer), media_type="application/json")
