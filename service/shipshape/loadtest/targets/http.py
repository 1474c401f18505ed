"""What REST and the Open Inference Protocol share: a connection a request under way, kept open for the next."""

from collections.abc import Callable
from typing import Any

import aiohttp
import orjson

from shipshape.loadtest.outcomes import Outcome, Reply
from shipshape.loadtest.targets.address import Address
from shipshape.loadtest.targets.target import CONNECT_S, TargetError

TIMEOUT_HEADER = "Shipshape-Timeout-Ms"
GRACE_S = (
    1.0  # after the deadline in which a target may still say that it is late, so that the connection lives on
)
CONTACT_OUTCOMES = {
    "overloaded": Outcome.REFUSED,
    "deadline_exceeded": Outcome.EXPIRED,
    "not_ready": Outcome.UNAVAILABLE,
}
OUTCOMES = {429: Outcome.REFUSED, 503: Outcome.UNAVAILABLE, 504: Outcome.EXPIRED}
JSON = "application/json"
Read = Callable[[Any], Reply]  # an answer's JSON -> how it counts


class HttpClient:
    """Opens another connection whenever all others are busy: a slow target does not slow the schedule."""

    def __init__(self, address: Address) -> None:
        self._address = address
        headers = {"Authorization": f"Bearer {address.keys.token}"} if address.keys.token else {}
        connector = aiohttp.TCPConnector(limit=0, ssl=address.keys.context() if address.secure else True)
        self._session = aiohttp.ClientSession(address.base_url, connector=connector, headers=headers)

    async def describe(self, path: str) -> dict[str, Any]:
        """The JSON object at a path; raises TargetError when there is none."""
        where = f"{self._address.base_url}{path}"
        try:
            async with self._session.get(path, timeout=aiohttp.ClientTimeout(CONNECT_S)) as response:
                body = await response.read()
                if response.status != 200:
                    raise TargetError(f"expected 200 from {where}, got {response.status}: {_words(body)}")
            value = orjson.loads(body)
        except (aiohttp.ClientError, OSError, orjson.JSONDecodeError) as error:
            raise TargetError(f"expected a description at {where}, got {type(error).__name__}: {error}") from error
        if not isinstance(value, dict):
            raise TargetError(f"expected a JSON object at {where}, got something else")
        return value

    async def post(self, path: str, body: bytes, media_type: str, deadline_s: float, read: Read) -> Reply:
        """Send a body; how it ended, as `read` has it of an answer's JSON."""
        headers = {"Content-Type": media_type, TIMEOUT_HEADER: f"{deadline_s * 1e3:g}"}
        timeout = aiohttp.ClientTimeout(deadline_s + GRACE_S)
        try:
            async with self._session.post(path, data=body, headers=headers, timeout=timeout) as response:
                answer = await response.read()
        except TimeoutError:
            return Reply(Outcome.EXPIRED, f"no answer {GRACE_S:g} s after the deadline")
        except (aiohttp.ClientError, OSError) as error:
            return Reply(Outcome.UNAVAILABLE, f"{type(error).__name__}: {error}")
        if response.status != 200:
            return Reply(OUTCOMES.get(response.status, Outcome.ERROR), f"{response.status}: {_words(answer)}")
        try:
            return read(orjson.loads(answer))
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            came = f"{type(error).__name__}: {error}"
            return Reply(Outcome.ERROR, f"expected an answer of the protocol, got another: {came}")

    async def close(self) -> None:
        """Close all connections."""
        await self._session.close()


def of_contact_error(kind: str, detail: str) -> Reply:
    """How a contact counts that got none of its scan's answers, by Shipshape's name for the reason."""
    return Reply(CONTACT_OUTCOMES.get(kind, Outcome.ERROR), f"{kind}: {detail}")


def _words(body: bytes) -> str:
    """What a refusal says: the detail of a problem document, the error of the Open Inference Protocol, or text."""
    try:
        value = orjson.loads(body)
        return str(value.get("detail") or value.get("error"))
    except (orjson.JSONDecodeError, AttributeError):
        return body.decode(errors="replace")
