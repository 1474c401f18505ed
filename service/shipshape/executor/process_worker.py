"""A worker in a process of its own, and what it works with; `fork_server` starts it."""

import os
import select
import socket
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn

from shipshape.errors import ShipshapeError
from shipshape.executor.costs import Costs
from shipshape.executor.entry import Entry
from shipshape.executor.messages import Inbox, packed
from shipshape.executor.ticket import Task
from shipshape.executor.worker import Worker

NICE = 5  # on a busy core the doors go first: refusals are soon given, and answers soon sent
LEARNED = 4  # one in so many entries is learned from: costs change slowly, and learning takes time


@dataclass(frozen=True, slots=True)
class Prepared:
    """What the workers work with.

    Attributes:
        description: For the service; has to be picklable.
        make: A task of what the service sent, and its deadline; raises what is wrong with it.
        costs: Of stages and rungs, as rehearsed.
    """

    description: Any
    make: Callable[[Any, float], Task[Any, Any]]
    costs: Costs


Prepare = Callable[..., Prepared]


def be_worker(connection: socket.socket, prepared: Prepared) -> NoReturn:
    """Work until the service closes the connection; this process then ends."""
    os.nice(NICE)
    try:
        with suppress(OSError):
            connection.sendall(packed(os.getpid()))
            Worker(SocketMailbox(connection, prepared), prepared.costs, time.monotonic).work()
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(1)


def as_message(error: BaseException) -> Exception:
    """The error itself if it is ours, else one with its traceback: it may be of a class that cannot travel."""
    if isinstance(error, ShipshapeError):
        return error
    return RuntimeError("".join(traceback.format_exception(error)))


class Report(NamedTuple):
    """What a worker says of an entry that ended; its first message of all is the number of its process."""

    number: int  # of the entry
    result: Any  # the answer, or an exception
    place: int = 0  # of the rung that it was computed on
    stage_ms: Mapping[str, float] = {}  # a NamedTuple has no default factory; nobody changes it
    began: float | None = None  # when it was taken up
    seconds: float = 0.0  # that the worker was busy with it


class SocketMailbox:
    """The mailbox of a worker in a process of its own.

    Args:
        connection: To the service.
        prepared: What it works with; its costs are learned.
    """

    LOOK_S = 5e-4  # a look costs as much as the shortest stages

    def __init__(self, connection: socket.socket, prepared: Prepared) -> None:
        self._connection = connection
        self._prepared = prepared
        self._inbox = Inbox()
        self._ended = 0
        self._numbers: dict[Entry, int] = {}  # of those that have not ended
        self._poll = select.poll()
        self._poll.register(connection, select.POLLIN)

    def read(self, *, wait: bool) -> Sequence[Entry] | None:
        """As `Mailbox.read`."""
        if not wait and not self._poll.poll(0):
            return ()
        messages = self._inbox.receive(self._connection)
        if messages is None:
            os._exit(0)  # nobody is left to answer
        return [entry for message in messages if (entry := self._taken(*message)) is not None]

    def others_wait(self) -> bool:
        """As `Mailbox.others_wait`: what it has not been given, it does not know of."""
        return False

    def ended(self, entries: Sequence[Entry]) -> None:
        """As `Mailbox.ended`; the service learns the cost of a whole rung, this end that of its stages."""
        self._send([self._report(entry) for entry in entries])

    def _report(self, entry: Entry) -> Report:
        self._ended += 1
        if self._ended % LEARNED == 0:
            for timed, seconds in entry.timed:
                self._prepared.costs.learn(timed, entry.task.size, seconds)
        error = entry.ticket.future.exception()
        result = entry.ticket.future.result() if error is None else as_message(error)
        number = self._numbers.pop(entry)
        return Report(number, result, entry.place, entry.stage_ms, entry.began, entry.busy)

    def _send(self, reports: Sequence[Report]) -> None:
        self._connection.sendall(b"".join(map(_packed, reports)))

    def _taken(self, number: int, *given: Any) -> Entry | None:
        if not given:  # taken back
            for entry, other in self._numbers.items():
                if other == number:
                    entry.ticket.cancel()
            return None
        order, deadline, place, why = given
        try:
            entry = Entry(self._prepared.make(order, deadline), time.monotonic)
        except Exception as error:
            self._send([Report(number, as_message(error))])
            return None
        entry.move_to(place, self._prepared.costs, why)
        self._numbers[entry] = number
        return entry


def _packed(report: Report) -> bytes:
    try:
        return packed(tuple(report))  # of plain values: one comes with every entry
    except Exception as error:  # an answer that cannot travel
        return packed(tuple(Report(report.number, as_message(error))))
