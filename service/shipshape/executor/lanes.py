"""Priority lanes: who goes first when workers are short, and how much of the queue each lane may fill."""

import math
from collections import OrderedDict
from collections.abc import Iterator
from enum import StrEnum
from typing import Generic, TypeVar

T = TypeVar("T")


class Lane(StrEnum):
    """What an answer is for, the most urgent first; a worker takes from the first lane that has work."""

    COLLISION = "collision"
    TRACKING = "tracking"
    BATCH = "batch"


# Share of the whole queue up to which a lane still gets in: what is above it is kept for the lanes before.
SHARES = {Lane.COLLISION: 1.0, Lane.TRACKING: 7 / 8, Lane.BATCH: 1 / 2}

UP_TO = {lane: tuple(Lane)[: place + 1] for place, lane in enumerate(Lane)}  # it, and the lanes before it


def places(lane: Lane, limit: int) -> int:
    """How long the whole queue of at most `limit` may get by work of this lane."""
    return math.ceil(SHARES[lane] * limit)


class Queues(Generic[T]):
    """One queue a lane, and the seconds of work in each. Not thread-safe: whoever uses it holds the lock."""

    def __init__(self) -> None:
        self._lanes: dict[Lane, OrderedDict[T, float]] = {lane: OrderedDict() for lane in Lane}
        self._seconds = dict.fromkeys(Lane, 0.0)
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[T]:
        """In the order in which workers will take them."""
        for queue in self._lanes.values():
            yield from queue

    def seconds(self, lane: Lane) -> float:
        """Of all work that goes before new work of this lane."""
        return sum(self._seconds[other] for other in UP_TO[lane])

    def count(self, lane: Lane) -> int:
        """Of all work that goes before new work of this lane."""
        return sum(len(self._lanes[other]) for other in UP_TO[lane])

    def append(self, lane: Lane, item: T, seconds: float) -> None:
        """Behind all others of its lane; `seconds` of work."""
        self._lanes[lane][item] = seconds
        self._seconds[lane] += seconds
        self._length += 1

    def put_back(self, lane: Lane, item: T, seconds: float) -> None:
        """Before all others of its lane: it had been taken once."""
        self.append(lane, item, seconds)
        self._lanes[lane].move_to_end(item, last=False)

    def first(self) -> tuple[Lane, T] | None:
        """The first of the first lane that has any."""
        for lane, queue in self._lanes.items():
            if queue:
                return lane, next(iter(queue))
        return None

    def take(self) -> tuple[Lane, T] | None:
        """The first, taken out."""
        if (first := self.first()) is not None:
            self.remove(*first)
        return first

    def remove(self, lane: Lane, item: T) -> bool:
        """Take this one out wherever it stands; whether it was there."""
        queue = self._lanes[lane]
        if item not in queue:
            return False
        self._seconds[lane] -= queue.pop(item)
        self._length -= 1
        if not queue:
            self._seconds[lane] = 0.0  # not what rounding left
        return True

    def before(self, lane: Lane) -> bool:
        """Whether anything waits in a lane before this one."""
        return any(self._lanes[other] for other in UP_TO[lane][:-1])
