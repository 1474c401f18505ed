"""Which endpoint is asked, hedges and cancellation, against services that do what the test says."""

import asyncio
import threading

import grpc
import numpy as np
import pytest

from client.scripted import PATIENCE
from shipshape.client import AsyncClient, Client, Contact, Endpoint
from shipshape.client.links import Link

CONTACT = Contact(np.zeros((12, 3), np.float32), "c7")
UNAVAILABLE = (grpc.StatusCode.UNAVAILABLE, "not_ready")


def test_the_preferred_endpoint_is_asked_as_long_as_it_holds_its_budget(aboard, shore):
    aboard.computing_ms = 40.0
    with Client(aboard.url, shore.url, timeout_s=PATIENCE) as client:
        client.probe()
        assert client.recognise(CONTACT).vessel == "aboard"
        aboard.budget_ms = 30.0
        client.probe()
        assert client.recognise(CONTACT).vessel == "shore"
        aboard.budget_ms = 10_000.0
        client.probe()
        assert client.recognise(CONTACT).vessel == "aboard"


def test_the_load_beside_an_answer_counts_for_the_next_one(aboard, shore):
    aboard.load, aboard.computing_ms, aboard.budget_ms = 0.0, 100.0, 5000.0
    slow = Endpoint(aboard.url, Link(60, 5, 600, 1, 1))  # asked for its capacity once
    with Client(slow, shore.url, timeout_s=PATIENCE) as client:
        client.probe()
        aboard.load = 100.0  # of which it has told nothing yet
        assert [client.recognise(CONTACT).vessel for _ in range(3)] == ["aboard", "shore", "shore"]
        assert client.status()[0].load == 100


def test_a_service_that_is_not_ready_is_not_asked(aboard, shore):
    aboard.serving = False
    with Client(aboard.url, shore.url, timeout_s=PATIENCE) as client:
        client.probe()
        assert client.recognise(CONTACT).vessel == "shore"
        assert aboard.asked == []


async def usual(client, count=25):
    for _ in range(count):
        await client.recognise(CONTACT)


def test_a_hedge_takes_the_first_answer_and_cancels_the_other_call(aboard, shore):
    async def run():
        async with AsyncClient(aboard.url, shore.url, timeout_s=PATIENCE, hedge=True) as client:
            await usual(client)
            assert shore.asked == []
            aboard.held = threading.Event()
            answer = await client.recognise(CONTACT)
            assert answer.vessel == "shore"
            assert await asyncio.to_thread(aboard.cancelled.wait, PATIENCE)

    asyncio.run(run())


def test_without_hedging_nothing_is_sent_twice(aboard, shore):
    async def run():
        async with AsyncClient(aboard.url, shore.url, timeout_s=PATIENCE) as client:
            await usual(client)
            aboard.held = threading.Event()
            call = asyncio.create_task(client.recognise(CONTACT))
            assert await asyncio.to_thread(aboard.entered.acquire, timeout=PATIENCE)
            aboard.held.set()
            assert (await call).vessel == "aboard"

    asyncio.run(run())
    assert shore.asked == []


def test_a_hedge_that_fails_does_not_spoil_the_first_call(aboard, shore):
    async def run():
        async with AsyncClient(aboard.url, shore.url, timeout_s=PATIENCE, hedge=True) as client:
            await usual(client)
            aboard.held = threading.Event()
            shore.refusals += [UNAVAILABLE]
            call = asyncio.create_task(client.recognise(CONTACT))
            while not shore.asked:
                await asyncio.sleep(0)
            aboard.held.set()
            assert (await call).vessel == "aboard"

    asyncio.run(run())


def test_a_call_that_is_cancelled_is_cancelled_in_the_service(aboard):
    async def run():
        async with AsyncClient(aboard.url, timeout_s=PATIENCE) as client:
            aboard.held = threading.Event()
            call = asyncio.create_task(client.recognise(CONTACT))
            assert await asyncio.to_thread(aboard.entered.acquire, timeout=PATIENCE)
            call.cancel()
            with pytest.raises(asyncio.CancelledError):
                await call
            assert await asyncio.to_thread(aboard.cancelled.wait, PATIENCE)

    asyncio.run(run())
