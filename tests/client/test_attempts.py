"""Retries, deadlines and what is sent, against services that do what the test says."""

import asyncio
import random
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import grpc
import numpy as np
import pytest

from client.scripted import PATIENCE, Scripted, gone, serving
from serving.fakes import until
from shipshape.client import Client, Contact, Endpoint, Lane, Wishes
from shipshape.client.attempts import Attempts
from shipshape.client.links import LAN, Link
from shipshape.client.route import Route
from shipshape.errors import (
    DeadlineExceeded,
    InvalidInput,
    NotReady,
    Overloaded,
    ServiceFault,
    SettingsError,
    TooLarge,
    Unauthenticated,
    Unprocessable,
    Unreachable,
)

CONTACT = Contact(np.zeros((12, 3), np.float32), "c7")
UNAVAILABLE = (grpc.StatusCode.UNAVAILABLE, "not_ready")
FORKED = """
import os, sys
import numpy as np
from shipshape.client import Client, Contact
def ask():
    with Client(sys.argv[1], timeout_s=5) as client:
        print(client.recognise(Contact(np.zeros((12, 3), np.float32))).vessel, flush=True)
ask()
if (child := os.fork()) == 0:
    ask()
    os._exit(0)
os.waitpid(child, 0)
"""
CROWDED = (grpc.StatusCode.RESOURCE_EXHAUSTED, "overloaded", 30)


@pytest.mark.parametrize("refusal", [UNAVAILABLE, (grpc.StatusCode.UNAVAILABLE,), CROWDED, CROWDED[:2]])
def test_what_may_help_is_tried_again_at_the_only_endpoint(aboard, refusal):
    aboard.refusals += [refusal] * 2
    with Client(aboard.url, timeout_s=PATIENCE) as client:
        assert client.recognise(CONTACT).vessel == "aboard"
    assert len(aboard.asked) == 3
    assert max(aboard.deadlines) <= PATIENCE * 1.02  # gRPC rounds them, to a hundredth


def test_all_attempts_together_have_one_deadline():
    given = []

    async def refuse(route, left_s):
        given.append(left_s)
        raise Overloaded("expected room, got none", retry_after_s=0.0)

    routes = [Route(name, LAN, random.Random(1)) for name in ("aboard", "shore")]
    with pytest.raises(Overloaded):
        asyncio.run(Attempts(routes, refuse, 0.2).run())
    assert given[0] <= 0.2
    assert given == sorted(given, reverse=True)
    assert len(given) >= 4
    assert given[-1] > 0


@pytest.mark.parametrize(
    ("refusal", "error"),
    [
        ((grpc.StatusCode.INVALID_ARGUMENT, "invalid_input"), InvalidInput),
        ((grpc.StatusCode.INVALID_ARGUMENT, "too_large"), TooLarge),
        ((grpc.StatusCode.INVALID_ARGUMENT, "unprocessable"), Unprocessable),
        ((grpc.StatusCode.UNAUTHENTICATED, "unauthenticated"), Unauthenticated),
        ((grpc.StatusCode.INTERNAL, "internal"), ServiceFault),
        ((grpc.StatusCode.DEADLINE_EXCEEDED, "deadline_exceeded"), DeadlineExceeded),
        ((grpc.StatusCode.RESOURCE_EXHAUSTED,), TooLarge),
        ((grpc.StatusCode.UNIMPLEMENTED,), ServiceFault),
    ],
)
def test_what_cannot_help_is_raised_at_once(aboard, shore, refusal, error):
    aboard.refusals += [refusal]
    with (
        Client(aboard.url, shore.url, timeout_s=PATIENCE) as client,
        pytest.raises(error, match=r"expected .+, got"),
    ):
        client.recognise(CONTACT)
    assert (len(aboard.asked), len(shore.asked)) == (1, 0)


def test_nothing_is_asked_after_its_deadline(aboard):
    aboard.refusals += [(grpc.StatusCode.RESOURCE_EXHAUSTED, "overloaded", 60_000)]
    with Client(aboard.url, timeout_s=PATIENCE) as client, pytest.raises(Overloaded) as caught:
        client.recognise(CONTACT)
    assert caught.value.retry_after_s == 60
    assert len(aboard.asked) == 1


@pytest.mark.parametrize("refusal", [UNAVAILABLE, CROWDED])
def test_another_endpoint_is_asked_at_once(aboard, shore, refusal):
    aboard.refusals += [refusal]
    with Client(aboard.url, shore.url, timeout_s=PATIENCE) as client:
        answer = client.recognise(CONTACT)
    assert (answer.vessel, answer.endpoint) == ("shore", shore.url)


def test_an_endpoint_that_is_gone_costs_no_answer(shore):
    url = gone()
    with Client(url, shore.url, timeout_s=PATIENCE) as client:
        assert [client.recognise(CONTACT).vessel for _ in range(5)] == ["shore"] * 5
        assert [status.resting for status in client.probe()] == [True, False]


def test_an_endpoint_that_rests_for_longer_than_there_is_time_is_asked_once_all_the_same(aboard):
    aboard.refusals += [UNAVAILABLE]
    long_rests = Link(60, 5, 600, first_backoff_s=60, longest_backoff_s=60)
    with Client(Endpoint(aboard.url, long_rests), timeout_s=PATIENCE) as client:
        with pytest.raises(NotReady):
            client.recognise(CONTACT)
        assert client.recognise(CONTACT).vessel == "aboard"
    assert len(aboard.asked) == 2


def test_why_nobody_can_be_asked_is_told(aboard, shore):
    aboard.locked = shore.locked = True
    with Client(aboard.url, shore.url, timeout_s=PATIENCE) as client:
        assert [type(status.failure) for status in client.probe()] == [Unauthenticated] * 2
        with pytest.raises(Unauthenticated):
            client.recognise(CONTACT)


def test_nobody_there_is_told_in_one_sentence():
    url = gone()
    with Client(url, timeout_s=0.5) as client, pytest.raises(Unreachable) as caught:
        client.recognise(CONTACT)
    assert str(caught.value).startswith(f"expected a service at {url}, got none: is it running")


def test_every_call_has_a_deadline_and_the_one_that_was_asked_for(aboard):
    with Client(aboard.url, timeout_s=7.0) as client:
        client.recognise(CONTACT)
        client.scan([CONTACT, CONTACT], timeout_s=3.0)
    assert 6 < aboard.deadlines[0] <= 7.1
    assert 2 < aboard.deadlines[1] <= 3.1


@pytest.mark.parametrize("timeout_s", [0, -1, float("nan"), 3601])
def test_deadlines_that_cannot_be_kept(timeout_s):
    with pytest.raises(SettingsError, match=r"expected timeout_s above 0 and up to 3600, got"):
        Client("grpc://127.0.0.1:1", timeout_s=timeout_s)


def test_a_silent_service_is_left_when_its_time_is_over(aboard):
    aboard.held = threading.Event()
    with (
        Client(aboard.url) as client,
        pytest.raises(DeadlineExceeded, match=r"expected an answer of grpc://.+ in time"),
    ):
        client.recognise(CONTACT, timeout_s=0.2)
    assert aboard.cancelled.wait(PATIENCE)


def test_wishes_and_contacts_arrive(aboard):
    contact = Contact(np.arange(36, dtype=np.float32).reshape(12, 3), "c8", 3.5, 20.0)
    wishes = Wishes(lane=Lane.COLLISION, bundle="default", captured_at=5.0, max_age_ms=100.0, restored=True)
    with Client(aboard.url) as client:
        client.recognise(contact, wishes)
    sent = aboard.asked[0]
    assert np.array_equal(np.frombuffer(sent.contact.points, "<f4").reshape(-1, 3), contact.points_level)
    assert (sent.contact.contact_id, sent.contact.sensor_height_m, sent.contact.own_true_heading_deg) == (
        "c8",
        3.5,
        20,
    )
    assert str(sent.options).split() == [
        "preset:",
        "PRESET_BEST",
        "image_method:",
        "IMAGE_METHOD_FULL_SIDE",
        "bundle:",
        '"default"',
        "include_restored:",
        "true",
        "lane:",
        "LANE_COLLISION",
        "lowest_rung:",
        "RUNG_HEADING_AND_BOX",
        "captured_at:",
        "5",
        "max_age_ms:",
        "100",
    ]


def test_a_client_outside_its_block_says_so(aboard):
    with pytest.raises(SettingsError, match=r"expected an open client, got one outside its `with` block"):
        Client(aboard.url).recognise(CONTACT)


def test_a_process_forked_from_one_that_used_a_client_can_use_one(aboard):
    command = [sys.executable, "-c", FORKED, aboard.url]
    ran = subprocess.run(command, capture_output=True, text=True, check=True, timeout=PATIENCE)
    assert ran.stdout == "aboard\naboard\n"


def test_threads_share_a_client(aboard):
    found = []
    with Client(aboard.url, timeout_s=PATIENCE) as client:
        threads = [
            threading.Thread(target=lambda: found.append(client.recognise(CONTACT).vessel)) for _ in range(8)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE)
    assert found == ["aboard"] * 8


def test_a_service_that_comes_and_goes_costs_no_answer(shore):
    """Stopped in the middle of calls, again and again, while eight threads ask."""
    service, found, over = Scripted("aboard"), [], threading.Event()

    def ask(client):
        while not over.is_set():
            found.append(client.recognise(CONTACT).vessel)

    with serving(service):
        port = int(service.url.rpartition(":")[2])
    with Client(service.url, shore.url, timeout_s=PATIENCE) as client, ThreadPoolExecutor(8) as threads:
        asking = [threads.submit(ask, client) for _ in range(8)]
        try:
            for _ in range(6):
                before = len(service.asked)
                with serving(service, port):
                    until(lambda before=before: len(service.asked) > before + 20 or any(a.done() for a in asking))
        finally:
            over.set()
        for each in asking:
            each.result(PATIENCE)
    assert {"aboard", "shore"} == set(found)
