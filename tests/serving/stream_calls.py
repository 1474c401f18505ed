"""A client of RecogniseStream that sends when it is told to."""

import queue
import threading
from contextlib import suppress

import grpc
import pytest

from serving.fakes import PATIENCE, cluster
from shipshape.v1 import shipshape_pb2 as pb

POINTS = cluster()
PACKED = POINTS.tobytes()
OK = grpc.StatusCode.OK


def message(sequence, *contact_ids, **fields):
    contacts = [pb.Contact(contact_id=contact_id, points=PACKED) for contact_id in contact_ids]
    return pb.RecogniseStreamRequest(sequence=sequence, contacts=contacts, **fields)


CALLS = []


@pytest.fixture(autouse=True)
def no_sender_waits_for_ever():
    yield
    while CALLS:
        CALLS.pop().close()


class Call:
    """One stream of a client that sends when it is told to."""

    def __init__(self, doors, *messages, metadata=None):
        self._outgoing = queue.SimpleQueue()
        self.responses = doors.stub.RecogniseStream(
            iter(self._outgoing.get, None), timeout=PATIENCE, metadata=metadata
        )
        self.send(*messages)
        CALLS.append(self)

    def send(self, *messages):
        for each in messages:
            self._outgoing.put(each)

    def close(self):
        self._outgoing.put(None)
        return self

    def next(self):
        return next(self.responses)

    def rest(self):
        """All further answers, and the code at their end."""
        answers = []
        with suppress(grpc.RpcError):
            for answer in self.responses:
                answers.append(answer)
        return answers, self.responses.code()


def errors(answers):
    return {answer.sequence: pb.ErrorKind.Name(answer.error.kind)[len("ERROR_KIND_") :] for answer in answers}


def readers():
    return [thread for thread in threading.enumerate() if thread.name == "grpc-reader"]


def idle(doors):
    counts = doors.service.executor.counts()
    return counts.pending == 0 and 'shipshape_in_flight{door="grpc"} 0.0' in doors.rest.get("/metrics").text


def time_passes(doors):
    for _ in range(30):
        doors.stub.GetModelInfo(pb.GetModelInfoRequest(), timeout=PATIENCE)
