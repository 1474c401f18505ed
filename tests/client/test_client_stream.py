"""Streams: every scan gets one answer, whatever the connection does."""

import asyncio
import itertools
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import grpc
import numpy as np
import pytest

from client.scripted import PATIENCE, Scripted, gone, of_any_shape, serving
from serving.fakes import until
from shipshape.client import AsyncClient, Client, Contact
from shipshape.errors import DeadlineExceeded, InvalidInput, SettingsError, Unauthenticated

POINTS = np.zeros((12, 3), np.float32)
UNAVAILABLE = (grpc.StatusCode.UNAVAILABLE, "not_ready")

# A program that leaves a stream whose source waits for something that never comes.
BLOCKED = """
import queue, sys
import numpy as np
from shipshape.client import Client, Contact
def source():
    yield [Contact(np.zeros((12, 3), np.float32))]
    queue.Queue().get()
with Client(sys.argv[1], timeout_s=20) as client:
    print(next(client.stream(source())).results[0].vessel)
"""


def scans(count, contacts=2):
    return [[Contact(POINTS, f"{scan}.{each}") for each in range(contacts)] for scan in range(count)]


def ids(answers):
    return sorted((answer.sequence, *(result.contact_id for result in answer.results)) for answer in answers)


def expected(count):
    return [(scan, f"{scan}.0", f"{scan}.1") for scan in range(count)]


def test_every_scan_is_answered_once(aboard):
    with Client(aboard.url, timeout_s=PATIENCE) as client:
        assert ids(client.stream(scans(40))) == expected(40)
    assert [request.sequence for request in aboard.asked] == list(range(40))


def test_no_more_are_taken_than_the_window(aboard):
    aboard.held = threading.Event()
    taken = []

    def source():
        for scan in scans(10):
            taken.append(scan)
            yield scan

    with Client(aboard.url, timeout_s=PATIENCE) as client:
        answers = client.stream(source(), window=3)
        threading.Timer(0, lambda: (aboard.entered.acquire(timeout=PATIENCE), aboard.held.set())).start()
        first = next(answers)
        assert len(taken) <= 5  # three, the one that waits for room, and the one that the first answer let in
        assert ids([first, *answers]) == expected(10)


def test_a_stream_that_breaks_goes_on_elsewhere_with_what_had_no_answer(aboard, shore):
    aboard.refusals += [None, None, UNAVAILABLE]
    aboard.refusals = Breaking(aboard.refusals)
    with Client(aboard.url, shore.url, timeout_s=PATIENCE) as client:
        answers = list(client.stream(scans(20)))
    assert ids(answers) == expected(20)
    assert {result.vessel for answer in answers for result in answer.results} == {"aboard", "shore"}


class Breaking(list):
    """Refusals, of which None lets a message pass."""

    def __bool__(self):
        if len(self) and self[0] is None:
            self.pop(0)
            return False
        return len(self) > 0


def test_a_service_that_restarts_is_found_again(aboard):
    aboard.refusals += [UNAVAILABLE] * 3
    with Client(aboard.url, timeout_s=PATIENCE) as client:
        assert ids(client.stream(scans(5))) == expected(5)


def test_a_service_that_comes_late_is_found():
    port = int(gone().rpartition(":")[2])
    started = threading.Event()

    def source():
        yield from scans(1)
        started.set()

    with Client(f"grpc://127.0.0.1:{port}", timeout_s=PATIENCE) as client:
        answers = client.stream(source())
        found = []
        reader = threading.Thread(target=lambda: found.extend(answers))
        reader.start()
        assert started.wait(PATIENCE)
        with serving(Scripted("late"), port):
            reader.join(PATIENCE)
    assert ids(found) == expected(1)


def test_a_scan_that_nobody_answers_ends_with_its_deadline():
    with Client(gone(), timeout_s=0.3) as client:
        answers = list(client.stream(scans(3)))
    assert sorted(answer.sequence for answer in answers) == [0, 1, 2]
    assert all(isinstance(answer.error, DeadlineExceeded) and answer.results == () for answer in answers)


def test_a_silent_service_does_not_hold_the_stream(aboard):
    aboard.held = threading.Event()
    with Client(aboard.url, timeout_s=0.3) as client:
        answers = list(client.stream(scans(2)))
    assert [type(answer.error).__mro__[1] for answer in answers] == [DeadlineExceeded] * 2


def test_a_service_that_ends_every_call_is_not_asked_all_the_time():
    class Ending(Scripted):
        calls = 0

        def RecogniseStream(self, requests, context):
            self.calls += 1
            return iter(())

    with serving(Ending("aboard")) as service, Client(service.url, timeout_s=1.0) as client:
        (answer,) = client.stream(scans(1))
    assert isinstance(answer.error, DeadlineExceeded)
    assert 2 <= service.calls <= 10  # the pause doubles; without one there are hundreds


def test_what_no_other_call_would_mend_ends_the_stream(aboard):
    aboard.locked = True
    with Client(aboard.url, timeout_s=PATIENCE) as client, pytest.raises(Unauthenticated):
        list(client.stream(scans(2)))


def test_a_scan_that_no_message_can_tell_does_not_end_the_stream(aboard):
    flat = [of_any_shape(POINTS.ravel())]
    with Client(aboard.url, timeout_s=PATIENCE) as client:
        answers = {each.sequence: each for each in client.stream([*scans(1), flat, *scans(1), flat])}
    assert [len(answers[sequence].results) for sequence in range(4)] == [2, 0, 2, 0]
    for sequence in (1, 3):
        assert isinstance(answers[sequence].error, InvalidInput)
        assert "got (36,)" in str(answers[sequence].error)
    assert [request.sequence for request in aboard.asked] == [0, 2]


@pytest.mark.parametrize("window", [0, -1])
def test_a_window_of_no_scan_is_refused(aboard, window):
    with (
        Client(aboard.url, timeout_s=PATIENCE) as client,
        pytest.raises(SettingsError, match=f"expected a window of 1 scan or more, got {window}"),
    ):
        list(client.stream(scans(1), window=window))


def test_what_the_source_raises_comes_after_the_answers(aboard):
    def source():
        yield from scans(2)
        raise OSError("the recording ends here")

    with Client(aboard.url, timeout_s=PATIENCE) as client:
        answers = client.stream(source())
        assert ids([next(answers), next(answers)]) == expected(2)
        with pytest.raises(OSError, match="the recording ends here"):
            next(answers)


def test_a_stream_that_is_left_early_is_cancelled(aboard):
    async def endless():
        number = 0
        while True:
            yield scans(1)[0]
            number += 1

    async def run():
        async with AsyncClient(aboard.url, timeout_s=PATIENCE) as client:
            answers = client.stream(endless())
            for _ in range(3):
                await anext(answers)
            await answers.aclose()
            return len(aboard.asked)

    assert asyncio.run(run()) >= 3


def test_a_source_that_blocks_for_ever_keeps_no_program_from_ending(aboard):
    command = [sys.executable, "-c", BLOCKED, aboard.url]
    ran = subprocess.run(command, capture_output=True, text=True, check=True, timeout=PATIENCE)
    assert ran.stdout == "aboard\n"


def test_an_error_of_a_message_does_not_end_the_stream(doors):
    """With the real service: a message of no contacts is refused, the others are answered."""
    url = f"grpc://127.0.0.1:{doors.addresses.grpc_port}"
    cluster = np.random.default_rng(0).random((40, 3)).astype(np.float32) * [2, 20, 4] + [40, -10, -2]
    good = Contact(cluster.astype(np.float32), "good")
    with Client(url, timeout_s=PATIENCE) as client:
        answers = sorted(client.stream([[good], [], [good, Contact(POINTS[:3], "few")]]), key=lambda a: a.sequence)
    assert [result.vessel for result in answers[0].results] == ["tug"]
    assert isinstance(answers[1].error, InvalidInput)
    assert answers[2].results[1].contact_id == "few"
    assert str(answers[2].results[1].error) == "expected at least 10 points in a cluster, got 3"


def test_a_stream_outlives_services_that_come_and_go():
    """Stopped in the middle of it, again and again: every scan is answered, once, and none with an error."""
    service, found = Scripted("aboard"), []
    with serving(service):
        port = int(service.url.rpartition(":")[2])
    over = threading.Event()

    def source():
        for number in itertools.count():
            if over.is_set():
                return
            yield [Contact(POINTS, str(number))]

    def read(client):
        found.extend(client.stream(source()))

    with Client(service.url, timeout_s=PATIENCE) as client, ThreadPoolExecutor(1) as thread:
        reading = thread.submit(read, client)
        try:
            for _ in range(5):
                before = len(service.asked)
                with serving(service, port):
                    until(lambda before=before: len(service.asked) > before + 50 or reading.done())
            with serving(service, port):
                over.set()
                reading.result(PATIENCE)
        finally:
            over.set()
    assert sorted(answer.sequence for answer in found) == list(range(len(found)))
    assert {answer.error for answer in found} == {None}
    assert len(service.asked) >= len(found) > 100
