"""Shipshape's REST door: packed points for one contact, JSON for several."""

import base64
from typing import Any, NamedTuple

import orjson

from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Reply, answered_on, worst
from shipshape.loadtest.targets.address import Address
from shipshape.loadtest.targets.http import JSON, HttpClient, of_contact_error
from shipshape.loadtest.targets.target import TargetError, TargetInfo

PACKED = "application/octet-stream"


class RestPayload(NamedTuple):
    """A body, and where it goes."""

    path: str
    body: bytes
    media_type: str


class RestTarget:
    """/v1/recognise and /v1/scan."""

    def __init__(self, address: Address) -> None:
        self._address = address

    async def open(self) -> TargetInfo:
        """As `Target.open`."""
        self._client = HttpClient(self._address)
        try:
            model = await self._client.describe("/v1/model")
            limits = model["limits"]
            return TargetInfo(model["version"], model["bundle_name"], model["bundle"], limits["budget_ms"])
        except KeyError as error:
            await self.close()
            raise TargetError(f"expected /v1/model of Shipshape, got one without {error}") from error
        except TargetError:
            await self.close()
            raise

    def encode(self, request: Request) -> RestPayload:
        """As `Target.encode`."""
        packed = [cluster.astype("<f4").tobytes() for cluster in request.clusters]
        if len(packed) == 1:
            query = f"?lane={request.lane}" if request.lane else ""
            return RestPayload(f"/v1/recognise{query}", packed[0], PACKED)
        contacts = [{"points_base64": base64.b64encode(points).decode("ascii")} for points in packed]
        options = {"lane": request.lane} if request.lane else {}
        return RestPayload("/v1/scan", orjson.dumps({"contacts": contacts, **options}), JSON)

    async def send(self, payload: RestPayload, deadline_s: float) -> Reply:
        """As `Target.send`."""
        read = _of_contact if payload.media_type == PACKED else _of_scan
        return await self._client.post(payload.path, payload.body, payload.media_type, deadline_s, read)

    async def close(self) -> None:
        """As `Target.close`."""
        await self._client.close()


def _of_contact(found: dict[str, Any]) -> Reply:
    return answered_on([found["rung"]])


def _of_scan(answer: dict[str, Any]) -> Reply:
    return worst([_of_result(result) for result in answer["results"]])


def _of_result(result: dict[str, Any]) -> Reply:
    if (found := result.get("recognition")) is not None:
        return _of_contact(found)
    return of_contact_error(result["error"]["error"], result["error"]["detail"])
