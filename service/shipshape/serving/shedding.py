"""A look at the queue before anything of a request is read: what is refused anyway shall cost nothing."""

from shipshape.errors import DeadlineExceeded, Overloaded
from shipshape.executor import Executor, Lane
from shipshape.executor.admission import HEADROOM
from shipshape.executor.lanes import places


def check_room(executor: Executor, lane: Lane, deadline: float) -> None:
    """Raise what admission would say to even the cheapest contact of this lane.

    Args:
        executor: Has the queue.
        lane: Of the request; the most urgent one where it is not known.
        deadline: On the executor's clock, seconds.

    Raises:
        DeadlineExceeded: The request is already late.
        Overloaded: No place in the queue, or no time behind all that waits.
    """
    left = deadline - executor.clock()
    if left <= 0:
        raise DeadlineExceeded("expected an answer before the deadline, got a request that is already late")
    if not (depth := executor.queue_depth):
        return
    wait, limit = executor.wait(lane), executor.queue_limit
    if depth >= places(lane, limit):
        raise Overloaded(
            f"expected at most 0 more in the queue of {limit}, got 1", retry_after_s=wait / max(1, depth)
        )
    if HEADROOM * wait > left:
        needed = HEADROOM * wait
        raise Overloaded(
            f"expected {needed * 1e3:.0f} ms for an answer behind all that waits, got {left * 1e3:.0f} ms",
            retry_after_s=needed - left,
        )
