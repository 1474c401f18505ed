"""The Open Inference Protocol v2 over HTTP, in JSON: any server that takes ragged clusters as two tensors.

Inputs: `points` FP32 [n, 3], the points of all contacts one after the other; `counts` INT32 [contacts], how many
each has. Of the outputs, where they are there: `rung` tells full answers from degraded ones; `error` names why a
contact got none, and `detail` says it in words.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import orjson

from shipshape.errors import SettingsError
from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Reply, answered_on, worst
from shipshape.loadtest.targets.address import Address
from shipshape.loadtest.targets.http import JSON, HttpClient, of_contact_error
from shipshape.loadtest.targets.target import TargetError, TargetInfo


class OipTarget:
    """v2/models/MODEL/infer."""

    def __init__(self, address: Address) -> None:
        self._address = address
        self._model = f"/v2/models/{model_of(address)}"

    async def open(self) -> TargetInfo:
        """As `Target.open`."""
        self._client = HttpClient(self._address)
        try:
            model = await self._client.describe(self._model)
        except TargetError:
            await self.close()
            raise
        versions = model.get("versions") or [""]
        return TargetInfo(version=str(model.get("platform", "")), bundle_name=str(versions[-1]))

    def encode(self, request: Request) -> bytes:
        """As `Target.encode`."""
        points = np.ascontiguousarray(np.concatenate(request.clusters))
        counts = [len(cluster) for cluster in request.clusters]
        inputs = [
            {"name": "points", "shape": points.shape, "datatype": "FP32", "data": points.ravel()},
            {"name": "counts", "shape": [len(counts)], "datatype": "INT32", "data": counts},
        ]
        return orjson.dumps({"inputs": inputs}, option=orjson.OPT_SERIALIZE_NUMPY)

    async def send(self, payload: bytes, deadline_s: float) -> Reply:
        """As `Target.send`."""
        return await self._client.post(f"{self._model}/infer", payload, JSON, deadline_s, _of_answer)

    async def close(self) -> None:
        """As `Target.close`."""
        await self._client.close()


def model_of(address: Address) -> str:
    """The model that a target names; raises SettingsError when it names none."""
    if not address.path:
        raise SettingsError(f"expected a model, as in {address.scheme}://{address.host}/shipshape, got none")
    return address.path


def _of_answer(answer: dict[str, Any]) -> Reply:
    return of_outputs({output["name"]: output["data"] for output in answer["outputs"]})


def of_outputs(outputs: Mapping[str, list[str]]) -> Reply:
    """How an answer counts, by the texts of its outputs; raises ValueError where they are not a contact's each."""
    errors = outputs.get("error", [])
    details = outputs.get("detail", [""] * len(errors))
    failed = [of_contact_error(kind, detail) for kind, detail in zip(errors, details, strict=True) if kind]
    return worst(failed) if failed else answered_on(outputs.get("rung", []))
