"""RecogniseStream: answers as they come, room, deadlines, and errors that leave the stream alone."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from serving.fakes import PATIENCE, request, running, until
from serving.stream_calls import OK, PACKED, POINTS, Call, errors, message, no_sender_waits_for_ever, time_passes
from shipshape.serving.clients import ClientLimits, Clients
from shipshape.serving.grpc.stream import Stream
from shipshape.serving.timing import Timeouts
from shipshape.v1 import shipshape_pb2 as pb

__all__ = ["no_sender_waits_for_ever"]


def test_every_message_is_answered_then_comes_ok(doors):
    call = Call(doors, *(message(7 * index, f"a{index}", f"b{index}") for index in range(50))).close()
    answers, code = call.rest()
    assert code is OK
    assert sorted(answer.sequence for answer in answers) == [7 * index for index in range(50)]
    for answer in answers:
        index = answer.sequence // 7
        assert [result.contact_id for result in answer.results] == [f"a{index}", f"b{index}"]
        assert all(result.recognition.vessel == "tug" for result in answer.results)
        assert [stage.stage for stage in answer.stages] == ["prior", "heading"]
        assert not answer.HasField("error")


def test_a_stream_of_nothing_is_ok(doors):
    assert Call(doors).close().rest() == ([], OK)


def test_answers_come_as_they_are_finished():
    with running(workers=2) as doors:
        call = Call(doors, message(1, "hold"), message(2, "quick"), message(3, "quick"))
        assert {call.next().sequence, call.next().sequence} == {2, 3}
        doors.pipeline.release.set()
        assert call.next().sequence == 1
        assert call.close().rest() == ([], OK)


def test_a_message_that_cannot_be_answered_gets_its_error_and_the_stream_goes_on(doors):
    bad = {
        1: message(1),
        2: message(2, *["x"] * 257),
        3: message(3, "a", options=pb.Options(preset=99)),
        4: message(4, "a", options=pb.Options(bundle="other")),
        5: message(5, "a", timeout_ms=0),
        6: message(6, "a", timeout_ms=float("nan")),
        7: message(7, "a", timeout_ms=3_600_001),
        8: message(8, "a", timeout_ms=1e-6),
    }
    call = Call(doors, *bad.values(), message(9, "good", "crash", timeout_ms=PATIENCE * 1e3)).close()
    answers, code = call.rest()
    assert code is OK
    late = {8: "DEADLINE_EXCEEDED"}
    assert errors(answers) == dict.fromkeys(bad, "INVALID_INPUT") | {2: "TOO_LARGE", 9: "UNSPECIFIED"} | late
    assert all(answer.error.message.startswith("expected ") for answer in answers if answer.sequence != 9)
    (last,) = [answer for answer in answers if answer.sequence == 9]
    assert [result.error.kind for result in last.results] == [0, pb.ERROR_KIND_INTERNAL]


def test_a_full_queue_refuses_the_message_not_the_stream():
    with running(queue_limit=2, max_contacts=2) as doors:
        held = Call(doors, message(1, "hold"))
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        full = doors.stub.RecogniseScan.future(pb.RecogniseScanRequest(contacts=message(0, "a", "b").contacts))
        until(lambda: doors.service.executor.queue_depth == 2)
        held.send(message(2, "a"))
        assert errors([held.next()]) == {2: "OVERLOADED"}
        doors.pipeline.release.set()
        assert held.next().sequence == 1
        assert len(full.result().results) == 2
        held.send(message(3, "a"))
        assert errors([held.next()]) == {3: "UNSPECIFIED"}


@pytest.mark.parametrize("own", [True, False])
def test_deadlines_hold_though_the_worker_is_busy(own):
    with running(default_timeout_ms=PATIENCE * 1e3 if own else 60) as doors:
        call = Call(doors, message(1, "hold", timeout_ms=PATIENCE * 1e3))
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        call.send(message(2, "late", timeout_ms=50 if own else None), message(3, "late", "late", timeout_ms=40))
        assert errors([call.next(), call.next()]) == {2: "DEADLINE_EXCEEDED", 3: "DEADLINE_EXCEEDED"}
        doors.pipeline.release.set()
        assert errors([call.next()]) == {1: "UNSPECIFIED"}
        assert "late" not in doors.pipeline.computed


def test_a_message_keeps_the_answers_that_came_in_time():
    with running(workers=2) as doors:
        answer = Call(doors, message(1, "hold", "quick", timeout_ms=1000)).next()
        kinds = [result.error.kind for result in answer.results]
        assert (kinds, answer.HasField("error")) == ([pb.ERROR_KIND_DEADLINE_EXCEEDED, 0], False)


def test_no_more_is_read_than_there_is_room_for():
    with running(queue_limit=8, max_contacts=4) as doors:
        call = Call(doors, message(0, "hold"), *(message(index, "a") for index in range(1, 200)))
        until(lambda: doors.service.executor.counts().offered == 4)
        time_passes(doors)
        assert doors.service.executor.counts().offered == 4
        doors.pipeline.release.set()
        answers, code = call.close().rest()
        assert (len(answers), set(errors(answers).values()), code) == (200, {"UNSPECIFIED"}, OK)


def test_a_caller_that_takes_no_answers_is_not_read_any_more():
    with running(max_contacts=4) as doors, ThreadPoolExecutor(1) as pool:
        taken = []
        stream = Stream(
            doors.service._core, doors.service._metrics, Timeouts(), lambda: Clients(ClientLimits()).share("")
        )
        messages = (taken.append(index) or message(index, "a") for index in range(20))
        reading = pool.submit(stream.read, messages)
        until(lambda: doors.service.executor.counts().completed == 4)
        time_passes(doors)
        assert taken == [0, 1, 2, 3]
        answers = map(pb.RecogniseStreamResponse.FromString, stream.answers())
        assert sorted(answer.sequence for answer in answers) == list(range(20))
        reading.result(PATIENCE)


def test_each_message_is_one_observation():
    with running(max_contacts=2, queue_limit=2) as doors:
        Call(doors, message(1, "a", "b"), message(2, "a"), message(3), message(4, *"abc")).close().rest()
        text = doors.rest.get("/metrics").text
    counted = 'shipshape_request_seconds_count{door="grpc",method="recognise_stream",outcome='
    assert f'{counted}"ok"}} 2.0' in text
    assert f'{counted}"invalid_input"}} 1.0' in text
    assert f'{counted}"too_large"}} 1.0' in text
    assert 'shipshape_contacts_total{door="grpc",outcome="ok"} 3.0' in text
    assert 'shipshape_contacts_total{door="grpc",outcome="too_large"} 3.0' in text


def test_the_same_bytes_as_a_scan(doors):
    options = pb.Options(include_restored=True, include_images=True, include_png=True, preset=pb.PRESET_PAPER)
    contacts = [*message(1, "a", "crash", "b").contacts, pb.Contact(contact_id="few", points=PACKED[:36])]
    scan = doors.stub.RecogniseScan(pb.RecogniseScanRequest(contacts=contacts, options=options), timeout=PATIENCE)
    streamed = Call(doors, pb.RecogniseStreamRequest(contacts=contacts, options=options)).close().rest()[0][0]
    for results in (scan.results, streamed.results):
        for result in results:
            result.recognition.ClearField("stages")
            result.error.message = result.error.message.rpartition(" ")[0]  # the id of an incident
    assert [each.SerializeToString() for each in streamed.results] == [
        each.SerializeToString() for each in scan.results
    ]


def test_unary_calls_go_on_beside_a_stream_that_fills_its_room():
    with running(workers=2) as doors:
        call = Call(doors, *(message(index, "a") for index in range(500))).close()
        assert doors.stub.Recognise(request(POINTS), timeout=PATIENCE).recognition.vessel == "tug"
        answers, code = call.rest()
        assert (len(answers), code) == (500, OK)
