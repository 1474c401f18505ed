import asyncio

import httpx
import pytest
from fastapi import FastAPI

from shipshape.errors import DeadlineExceeded, InvalidInput, TooLarge
from shipshape.serving.faults import FaultKind, fault_of
from shipshape.serving.rest.problems import add_handlers


@pytest.fixture
def ask():
    app = FastAPI()
    add_handlers(app)

    @app.get("/half")
    def half(number: int) -> float:
        return 0.5 / number

    async def get(url):
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
            return await client.get(url)

    return lambda url: asyncio.run(get(url))


def test_the_frameworks_validation_becomes_a_problem(ask):
    response = ask("/half?number=few")
    assert response.status_code == 400
    assert response.headers["content-type"] == "application/problem+json"
    assert response.json()["detail"].startswith("expected another value of query.number, got: ")


def test_what_nobody_foresaw_becomes_a_problem(ask):
    response = ask("/half?number=0")
    assert response.status_code == 500
    assert response.headers["content-type"] == "application/problem+json"
    assert "division" not in response.text


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (TooLarge("big"), FaultKind.TOO_LARGE),
        (InvalidInput("odd"), FaultKind.INVALID_INPUT),
        (DeadlineExceeded("late"), FaultKind.DEADLINE_EXCEEDED),
    ],
)
def test_a_meant_error_keeps_its_words(error, kind):
    assert fault_of(error).kind is kind
    assert fault_of(error).message == str(error)


def test_two_incidents_have_two_ids():
    first, second = fault_of(ValueError("x")), fault_of(ValueError("x"))
    assert first.kind is second.kind is FaultKind.INTERNAL
    assert first.message != second.message
