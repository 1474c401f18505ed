"""How large the answer to a scan may get: a few bytes may wish for megabytes of each contact.

Counted in JSON, the longest form, for every door: the same scan is refused by all of them or by none.
"""

from collections.abc import Sequence

from shipshape.errors import TooLarge
from shipshape.serving.encoding import Wishes
from shipshape.types import Contact

MOST_MIB = 64  # an answer is in memory several times over while it is written
# What parts of a recognition take at most, bytes; points are those measured, and as many inferred as images hold.
BARE_BYTES, RESTORED_POINT_BYTES, INFERRED_POINTS, IMAGES_BYTES, PNG_BYTES = 4096, 42, 4096, 20_000, 700_000


def check_answer(contacts: Sequence[Contact | Exception], wishes: Wishes) -> None:
    """Raises TooLarge for contacts whose answers might fill the memory."""
    if (most := most_bytes(contacts, wishes)) > MOST_MIB * 2**20:
        raise TooLarge(
            f"expected a scan whose answer takes at most {MOST_MIB} MiB in JSON, got one that may take "
            f"{most / 2**20:.0f} MiB: send fewer contacts at a time, or ask for less of each"
        )


def most_bytes(contacts: Sequence[Contact | Exception], wishes: Wishes) -> int:
    """How long the answer to these contacts may be."""
    each = BARE_BYTES + wishes.images * IMAGES_BYTES + wishes.png * PNG_BYTES
    if wishes.restored:
        each += INFERRED_POINTS * RESTORED_POINT_BYTES
    points = sum(len(contact.points_level) for contact in contacts if isinstance(contact, Contact))
    return len(contacts) * each + wishes.restored * points * RESTORED_POINT_BYTES
