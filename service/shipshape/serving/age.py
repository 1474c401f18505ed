"""How old what the LiDAR saw may be: a quick answer about what was 3 s ago misleads whoever steers by it."""

from shipshape.errors import DeadlineExceeded, InvalidInput
from shipshape.serving.encoding import Wishes

CLOCKS_S = 1.0  # by which the caller's clock may be ahead of ours


def age_of(wishes: Wishes, now: float) -> float | None:
    """Seconds since the capture, at least 0; None when the caller did not tell.

    Args:
        wishes: Of the caller.
        now: Seconds since 1970 (UTC), by our clock; the caller's should show the same.

    Raises:
        InvalidInput: A limit on the age without the moment of the capture, or a capture in the future.
    """
    if wishes.captured_at is None:
        if wishes.max_age_s is not None:
            raise InvalidInput("expected captured_at beside max_age_ms, got none")
        return None
    age = now - wishes.captured_at
    if not age >= -CLOCKS_S:
        raise InvalidInput(
            f"expected captured_at in the past, got {-age:.1f} s in the future: are the clocks the same?"
        )
    return max(0.0, age)


def time_left(age: float, wishes: Wishes) -> float:
    """Seconds until what was seen is too old.

    Raises:
        DeadlineExceeded: It is already.
    """
    if wishes.max_age_s is None:
        return float("inf")
    if age >= wishes.max_age_s:
        raise DeadlineExceeded(
            f"expected points of at most {wishes.max_age_s * 1e3:.0f} ms ago, got some of {age * 1e3:.0f} ms ago"
        )
    return wishes.max_age_s - age
