"""Yes or no to new work, at once: will it end in time behind all that stands before it, and on which rung?"""

from collections.abc import Sequence

from shipshape.errors import DeadlineExceeded, Overloaded
from shipshape.executor.costs import Costs
from shipshape.executor.entry import Entry, why_cheaper
from shipshape.executor.lanes import Lane, places

HEADROOM = 1.25  # over the predicted time: costs are means, and half of all work takes longer
QUEUE_HEADROOM = 1.5  # over that of a queue: when much is asked, the doors take more of the cores
AHEAD_S = 0.040  # of work that a worker is given at a time; it takes turns there, and the first ends with the last
STANDING_S = 0.250  # without a moment of rest, after which a queue is no burst that will soon be over


def settle_rungs(entries: Sequence[Entry], costs: Costs, *, wait: float, slack: float, workers: int) -> None:
    """Put all entries of one request on the dearest place of their ladders that will end in time.

    Args:
        entries: At least one.
        costs: Of their stages.
        wait: Seconds until a worker will be free for the first of them; 0 when nothing stands before them.
        slack: Seconds until their deadline.
        workers: That share them.

    Raises:
        DeadlineExceeded: Not even alone would they end in time.
        Overloaded: They would, but for what stands before them; says when to come back.
    """
    full = 0.0
    for place in range(max(len(entry.task.ladder) for entry in entries)):
        alone = _seconds(entries, costs, place, workers)
        full = full or wait + alone
        if with_headroom(wait, alone) <= slack:
            break
    else:
        if wait > 0:  # with nobody before it, let it try: costs are learned from what runs
            _refuse(wait, alone, slack)
    why = why_cheaper(full, slack) if place else ""
    for entry in entries:
        entry.move_to(place, costs, why)


def check_room(wanted: int, lane: Lane, *, limit: int, depth: int, wait: float) -> None:
    """Refuse so many tasks of a lane if they have no place in the queue.

    Args:
        wanted: How many.
        lane: Of all of them.
        limit: How long the queue may get.
        depth: How long it is.
        wait: Seconds until a worker will be free for the first of them.

    Raises:
        Overloaded: Says when to come back.
    """
    room = max(0, places(lane, limit) - depth)
    if wanted > room:
        raise Overloaded(
            f"expected at most {room} more in the queue of {limit}, got {wanted}",
            retry_after_s=wait * min(1.0, (wanted - room) / max(1, depth)),
        )


def behind(seconds: float, busy_s: float) -> float:
    """Seconds that new work will wait behind so many seconds of work, when no worker rested for `busy_s`.

    A queue that stands is kept short: being long it would make everybody late and nobody more in time, and leave
    its work no time to take turns with what comes behind it.
    """
    return seconds + min(seconds, AHEAD_S) if busy_s > STANDING_S else seconds


def check_wait(wait: float, slack: float) -> None:
    """Refuse whatever it is, however cheap, that has no time behind what stands before it; seconds.

    Raises:
        Overloaded: Says when to come back.
    """
    if (needed := with_headroom(wait, 0.0)) > slack:
        raise _late(needed, slack)


def with_headroom(wait: float, alone: float) -> float:
    """Seconds that can be promised to work that waits `wait` and takes `alone`, both as predicted."""
    return QUEUE_HEADROOM * wait + HEADROOM * alone


def _seconds(entries: Sequence[Entry], costs: Costs, place: int, workers: int) -> float:
    each = [entry.expected(place, costs) for entry in entries]
    return max(*each, sum(each) / workers)


def _refuse(wait: float, alone: float, slack: float) -> None:
    if HEADROOM * alone > slack:
        raise DeadlineExceeded(
            f"expected at least {HEADROOM * alone * 1e3:.1f} ms for an answer, got {slack * 1e3:.1f} ms"
        )
    raise _late(with_headroom(wait, alone), slack)


def _late(needed: float, slack: float) -> Overloaded:
    return Overloaded(
        f"expected {needed * 1e3:.0f} ms for an answer behind all that waits, got {slack * 1e3:.0f} ms",
        retry_after_s=needed - slack,
    )
