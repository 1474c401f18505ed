"""The pipeline in this process, for when no service answers: needs the whole package and a bundle.

Nothing of it is imported before a client is opened that asks for it.
"""

import asyncio
import time
from collections.abc import Awaitable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from shipshape.client.answers import LOCAL, Answer, Refusal
from shipshape.client.wishes import Wishes
from shipshape.errors import DeadlineExceeded, InvalidInput, ShipshapeError
from shipshape.types import Contact, Options, Recognition

T = TypeVar("T")
SLOWER = 2.0  # times its last answer: what is kept of a deadline for one more


class Local:
    """A warm pipeline; `reserve_s` seconds are what it may need for one contact.

    Args:
        folder: Of the bundle; None: that which `shipshape serve` would take.

    Raises:
        BundleError: No bundle that can be used.
    """

    def __init__(self, folder: Path | None) -> None:
        # Seconds of imports, hundreds of megabytes: only for those who asked for it.
        from shipshape.bundle import load_bundle  # noqa: PLC0415  large, and only needed where nobody else answers
        from shipshape.pipeline import Pipeline  # noqa: PLC0415  large, and only needed where nobody else answers
        from shipshape.sample import sample_contact  # noqa: PLC0415  large, and only needed where nobody else answers
        from shipshape.settings import default_bundle  # noqa: PLC0415  large, and only needed where nobody else answers

        self._pipeline: Pipeline = Pipeline(load_bundle(folder or default_bundle()))
        self.reserve_s = 0.0
        for _ in range(2):  # the first compiles and fills caches
            self._recognise(sample_contact(), Wishes())

    async def recognise(self, contact: Contact, wishes: Wishes) -> Answer:
        """The answer to one contact; raises InvalidInput and DeadlineExceeded as a service would."""
        return await asyncio.to_thread(self._recognise, contact, wishes)

    async def scan(self, contacts: list[Contact], wishes: Wishes) -> tuple[Answer | Refusal, ...]:
        """The answers to many contacts, one after the other."""
        return tuple([await self._result(contact, wishes) for contact in contacts])

    async def _result(self, contact: Contact, wishes: Wishes) -> Answer | Refusal:
        try:
            return await self.recognise(contact, wishes)
        except ShipshapeError as error:
            return Refusal(contact.contact_id, error)

    def _recognise(self, contact: Contact, wishes: Wishes) -> Answer:
        bundle = self._pipeline.bundle
        if wishes.bundle not in ("", bundle.name, bundle.digest):
            raise InvalidInput(f"expected bundle {wishes.bundle!r:.80}, got {bundle.name} ({bundle.digest})")
        started = time.monotonic()
        contact = Contact(
            np.asarray(contact.points_level, np.float32),
            contact.contact_id,
            contact.sensor_height,
            contact.own_true_heading_deg,
        )
        found = self._pipeline.run(contact, Options(wishes.preset, wishes.image_method, wishes.lowest_rung))
        self.reserve_s = SLOWER * (time.monotonic() - started)
        _check_age(wishes)
        return _answer(contact, found, wishes)


async def within(deadline: float, answer: Awaitable[T]) -> T:
    """The answer, if it is there by the deadline on the monotonic clock.

    Raises:
        DeadlineExceeded: It is not. What was begun of it ends by itself; its remaining contacts are left.
    """
    try:
        async with asyncio.timeout(deadline - time.monotonic()):
            return await answer
    except TimeoutError:
        raise DeadlineExceeded("expected an answer of this process in time, got none") from None


def _check_age(wishes: Wishes) -> None:
    if wishes.max_age_ms is None:
        return
    if wishes.captured_at is None:
        raise InvalidInput("expected captured_at beside max_age_ms, got none")
    if (age_ms := (time.time() - wishes.captured_at) * 1e3) >= wishes.max_age_ms:
        raise DeadlineExceeded(f"expected points of at most {wishes.max_age_ms:.0f} ms ago, got {age_ms:.0f} ms")


def _answer(contact: Contact, found: Recognition, wishes: Wishes) -> Answer:
    png = None
    if wishes.png:
        from shipshape.render import render_png  # noqa: PLC0415  large, and only needed where nobody else answers

        png = render_png(contact, found)
    same: dict[str, Any] = {
        name: getattr(found, name) for name in Answer.__slots__ if name in (*Recognition.__slots__, *_COUNTS)
    }
    same |= {
        "restored": found.restored if wishes.restored else None,
        "images": found.images if wishes.images else None,
    }
    return Answer(contact_id=contact.contact_id, png=png, endpoint=LOCAL, **same)


_COUNTS = ("measured_points", "inferred_points")
