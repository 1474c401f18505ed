"""Contacts -> a running service, in the batch lane, as often as it is too busy -> their answers."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from shipshape.batch.recognition import AnswerAll, Answered
from shipshape.client import Client, Endpoint, Info, Lane, Refusal, Rung, Wishes
from shipshape.errors import DeadlineExceeded, NotReady, Overloaded, SettingsError, ShipshapeError, Unreachable
from shipshape.types import Contact, Options

CONTACTS = 32  # of a scan: few enough to leave room for the lanes before
TIMEOUT_S, PATIENCE_S, PAUSE_S = 60.0, 600.0, 0.2
POINT_BYTES, ID_LENGTH = 12, 256  # of a point and of a contact's id in a request
ADVICE = "split a scan into clusters first"
BUSY = (Overloaded, DeadlineExceeded, NotReady, Unreachable)


class Service:
    """A running service, which may be asked from many threads, for as long as this process lives.

    Args:
        endpoint: Where it is.
        sleep: Waits so many seconds.

    Raises:
        SettingsError: No service of shipshape.v1 answers there.
        FileError: A PEM or token file cannot be read.
    """

    def __init__(self, endpoint: Endpoint, sleep: Callable[[float], None] = time.sleep) -> None:
        self._client = Client(endpoint, timeout_s=TIMEOUT_S).__enter__()  # for good: nobody says when all is asked
        self._sleep = sleep
        info = self._client.info()[endpoint.url]
        if not isinstance(info, Info):
            raise SettingsError(f"expected shipshape.v1 at {endpoint.url}, got: {info}") from info
        self.version, self.bundle = info.version, info.bundle
        self._contacts = min(CONTACTS, info.max_contacts)
        self._points = info.max_points
        self._points_a_scan = info.max_body_bytes // 2 // POINT_BYTES

    def answers_of(self, options: Options, *, restored: bool) -> AnswerAll:
        """Its answers, always in full and by the bundle that it had at first."""
        wishes = Wishes(
            preset=options.preset,
            image_method=options.image_method,
            lane=Lane.BATCH,
            lowest_rung=Rung.FULL,
            bundle=self.bundle,
            restored=restored,
        )

        def answers(contacts: Sequence[Contact]) -> Iterator[Answered]:
            """A scan after the other."""
            for group in self._groups(contacts):
                yield from self._ask(group, wishes)

        return answers

    def _groups(self, contacts: Sequence[Contact]) -> Iterator[list[Contact]]:
        group: list[Contact] = []
        points = 0
        for contact in contacts:
            size = len(contact.points_level)
            if group and (len(group) == self._contacts or points + size > self._points_a_scan):
                yield group
                group, points = [], 0
            group.append(replace(contact, contact_id=contact.contact_id[:ID_LENGTH]))
            points += size
        if group:
            yield group

    def _ask(self, group: list[Contact], wishes: Wishes) -> list[Answered]:
        """The answers to a group; what the service is too busy for is asked again."""
        # What is over the limit of a contact is not sent: it would be refused with all others in its scan.
        answers: dict[int, Answered] = {
            index: f"expected at most {self._points} points in a cluster, got {points}: {ADVICE}"
            for index, contact in enumerate(group)
            if (points := len(contact.points_level)) > self._points
        }
        until = time.monotonic() + PATIENCE_S
        while missing := [index for index in range(len(group)) if index not in answers]:
            answers |= self._ask_once(group, missing, wishes)
            if len(answers) < len(group):
                if time.monotonic() > until:
                    raise ShipshapeError(
                        f"expected the service to take batch work within {PATIENCE_S:g} s, got refusals alone: "
                        "run the same command again when it is less busy, it goes on where it was stopped"
                    )
                self._sleep(PAUSE_S)
        return [answers[index] for index in range(len(group))]

    def _ask_once(self, group: list[Contact], missing: list[int], wishes: Wishes) -> dict[int, Answered]:
        """The answers to those that are missing, but for those that it was too busy for."""
        try:
            results = self._client.scan([group[index] for index in missing], wishes)
        except BUSY:
            return {}
        except ShipshapeError as error:
            raise ShipshapeError(f"expected answers of the service, got: {error}") from error
        return {
            index: str(result.error) if isinstance(result, Refusal) else result
            for index, result in zip(missing, results, strict=True)
            if not (isinstance(result, Refusal) and isinstance(result.error, BUSY))
        }
