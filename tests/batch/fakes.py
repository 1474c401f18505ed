"""An engine whose answers need no networks: everything else of a run is real."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from builders_recognition import recognised
from shipshape.batch.processes import run_ahead
from shipshape.batch.reading import read
from shipshape.batch.recognition import Recogniser
from shipshape.errors import InvalidInput
from shipshape.types import Contact
from shipshape.validation import ContactLimits, check_contact

WORKERS = 2


@dataclass
class FakeEngine:
    """Takes the heading of a contact for the bearing of its middle, after checking it as the pipeline does."""

    method: object
    bundle: str = "f" * 64
    code: str = "test"
    computed: int = 0

    def answers(self, contacts: Sequence[Contact]):
        for contact in contacts:
            self.computed += 1
            try:
                check_contact(contact, ContactLimits())
            except InvalidInput as error:
                yield str(error)
                continue
            x, y, _ = contact.points_level.mean(axis=0).tolist()
            _, recognition = recognised()
            yield replace(recognition, heading=float(np.arctan2(y, x)), vessel="tug" if y > 0 else "rhib")

    def run(self, sources, method, done):
        recogniser = Recogniser(self.answers, method, self.bundle, self.code)
        chunks = (chunk for source in sources for chunk in read(source, method, done))
        return run_ahead(ThreadPoolExecutor(WORKERS), recogniser, chunks, 2 * WORKERS)
