"""One call of RecogniseStream: two threads, however many messages are under way.

message --reader--> core --workers--> finished --writer--> response

The reader takes a message whenever there is room, and leaves it to the transport to hold up the caller when there
is none. The writer sends each answer when its last contact is settled; room is free once the answer was taken.
"""

import math
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field

import grpc

from shipshape.errors import InvalidInput
from shipshape.executor import Lane
from shipshape.serving.clients import Share
from shipshape.serving.core import Core, Scan, conclude
from shipshape.serving.encoding import Wishes, check_contacts
from shipshape.serving.faults import fault_of
from shipshape.serving.grpc import convert
from shipshape.serving.timing import LONGEST_MS, Timeouts
from shipshape.telemetry import STREAM, Metrics, Outcome
from shipshape.v1 import shipshape_pb2 as pb


@dataclass(slots=True, eq=False)
class _Message:
    """A message under way: read, and its answer not yet taken."""

    sequence: int
    contact_ids: list[str]
    span: ExitStack  # its time in the metrics, until it is closed
    outcome: Outcome
    wishes: Wishes = field(default_factory=Wishes)
    scan: Scan[bytes] = field(default_factory=lambda: Scan([]))
    refusal: Exception | None = None  # of the message as a whole
    deadline: float = math.inf  # on the executor's clock
    unsettled: int = 1  # tickets, and the submission itself

    @property
    def contacts(self) -> int:
        """How much room it takes; one without contacts takes some too."""
        return max(1, len(self.contact_ids))


class Stream:
    """The messages of one call; `read` and `answers` each need a thread of their own.

    Args:
        core: Answers.
        metrics: Told of every message.
        timeouts: Deadline of messages that set none.
        share: What one message of this caller takes of its limits.
    """

    def __init__(self, core: Core, metrics: Metrics, timeouts: Timeouts, share: Callable[[], Share]) -> None:
        self._core = core
        self._metrics = metrics
        self._timeouts = timeouts
        self._share = share
        self._changed = threading.Condition()  # guards everything below
        self._under_way: set[_Message] = set()
        self._contacts = 0  # of those under way
        self._finished: deque[_Message] = deque()
        self._wakes_at = math.inf  # when the writer looks for deadlines by itself
        self._ended = False  # no more is read
        self._error: Exception | None = None  # that ended it
        self._left = False  # nobody wants the answers
        self._closed = False  # the writer has gone

    def read(self, requests: Iterator[pb.RecogniseStreamRequest]) -> None:
        """Take messages until the caller has sent its last one, or something ends the stream."""
        try:
            while self._has_room() and (request := next(requests, None)) is not None:
                self._begin(request)
        except grpc.RpcError:  # the call is over, of which `leave` is told as well
            self.leave()
        except Exception as error:
            self.end(error)
        else:
            self.end(None)

    def answers(self) -> Iterator[bytes]:
        """The response to each message as soon as it is there.

        Raises:
            Exception: What `end` was told, after the last answer.
        """
        try:
            while (message := self._next()) is not None:
                try:
                    yield self._answer(message)
                finally:
                    self._release(message)
        finally:  # also where the transport takes no more answers and drops this generator at its yield
            self.leave()
            while (message := self._next()) is not None:
                self._answer(message)
                self._release(message)
        if self._error is not None:
            raise self._error

    def end(self, error: Exception | None) -> None:
        """Read no more; answer what was read, then end with `error`, or well. What ended it first counts."""
        with self._changed:
            if not self._ended:
                self._ended, self._error = True, error
            self._changed.notify_all()

    def leave(self) -> None:
        """The caller has gone: drop what is under way."""
        with self._changed:
            self._ended = self._left = True
            messages = list(self._under_way)
            self._changed.notify_all()
        for (
            message
        ) in messages:  # not under the lock: each tells `_settle`, and the executor, which has a lock too
            _drop(message)

    def _has_room(self) -> bool:
        most = self._core.limits.max_contacts
        with self._changed:
            self._changed.wait_for(lambda: self._ended or self._contacts < most)
            return not self._ended

    def _begin(self, request: pb.RecogniseStreamRequest) -> None:
        with self._changed:
            if self._closed:
                return
            span = ExitStack()
            outcome = span.enter_context(self._metrics.request("grpc", STREAM))
            outcome.contacts = len(request.contacts)
            message = _Message(request.sequence, [each.contact_id for each in request.contacts], span, outcome)
            self._under_way.add(message)
            self._contacts += message.contacts
        try:
            self._submit(message, request)
        except Exception as error:
            message.refusal = error
        for ticket in message.scan.tickets:
            ticket.future.add_done_callback(lambda _: self._settle(message))
        self._settle(message)

    def _submit(self, message: _Message, request: pb.RecogniseStreamRequest) -> None:
        model = self._core.model()
        deadline = self._core.deadline_in(self._seconds(request))
        message.wishes = convert.to_wishes(request.options)
        message.outcome.urgent = message.wishes.lane is not Lane.BATCH
        check_contacts(len(request.contacts), self._core.limits)
        message.span.enter_context(self._share()).take(len(request.contacts))
        contacts = convert.to_contacts(request.contacts, self._core.limits)
        scan = self._core.submit_scan(model, contacts, message.wishes, convert.encode_in_stream, deadline)
        with self._changed:
            message.scan, message.deadline = scan, deadline
            message.unsettled += len(scan.tickets)
            if deadline < self._wakes_at:
                self._changed.notify_all()
        if self._left:
            _drop(message)

    def _seconds(self, request: pb.RecogniseStreamRequest) -> float:
        milliseconds = request.timeout_ms if request.HasField("timeout_ms") else self._timeouts.default_ms
        if not 0 < milliseconds <= LONGEST_MS:
            raise InvalidInput(f"expected timeout_ms above 0 and up to {LONGEST_MS:.0f}, got {milliseconds:g}")
        return milliseconds / 1e3

    def _settle(self, message: _Message) -> None:
        with self._changed:
            message.unsettled -= 1
            if not message.unsettled:
                self._finished.append(message)
                self._changed.notify_all()

    def _next(self) -> _Message | None:
        """The next message that is finished; None when there will be no more."""
        while True:
            with self._changed:
                if self._finished:
                    return self._finished.popleft()
                if self._ended and not self._under_way:
                    self._closed = True
                    return None
                self._wakes_at = min((message.deadline for message in self._under_way), default=math.inf)
                self._changed.wait(min(self._core.seconds_until(self._wakes_at), threading.TIMEOUT_MAX))
                messages = [message for message in self._under_way if message.deadline <= self._wakes_at]
            if messages and not self._core.seconds_until(self._wakes_at):
                for message in messages:
                    for ticket in message.scan.tickets:
                        ticket.expire()  # does nothing to one that has its answer

    def _answer(self, message: _Message) -> bytes:
        with message.span:
            try:
                if message.refusal is not None:
                    raise message.refusal
                outcomes, stage_ms = conclude(message.scan, "grpc", self._metrics)
                message.outcome.computed(stage_ms)
                results = convert.joined(pb.RecogniseStreamResponse, message.contact_ids, outcomes)
                stages = convert.from_stage_ms(stage_ms)
                rest = pb.RecogniseStreamResponse(sequence=message.sequence, stages=stages)
                return results + rest.SerializeToString()
            except Exception as error:
                fault = fault_of(error)
                message.outcome.kind = fault.kind
                refused = pb.RecogniseStreamResponse(sequence=message.sequence, error=convert.from_fault(fault))
                return refused.SerializeToString()

    def _release(self, message: _Message) -> None:
        with self._changed:
            self._under_way.remove(message)
            self._contacts -= message.contacts
            self._changed.notify_all()


def _drop(message: _Message) -> None:
    for ticket in message.scan.tickets:
        ticket.cancel()  # does nothing to one that is settled
