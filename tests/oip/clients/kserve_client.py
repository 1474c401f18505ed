"""Everything our tests ask of KServe's own clients: `kserve_client.py REST GRPC SCAN.npz` prints JSON."""

import asyncio
import json
import sys

import grpc
import httpx
import numpy as np
from kserve import InferenceGRPCClient, InferenceRESTClient, InferInput, InferRequest
from kserve.inference_client import RESTConfig
from kserve.protocol.infer_type import RequestedOutput

NAMES = ["contact_id", "vessel", "probability", "heading", "box"]


def listed(response):
    """The outputs as lists; BYTES as text."""
    found = {}
    for output in response.outputs:
        values = output.as_numpy().tolist()
        texts = output.datatype == "BYTES"
        found[output.name] = (
            [item.decode() if isinstance(item, bytes) else item for item in values] if texts else values
        )
    return found


def tensor(name, datatype, array, *, binary):
    made = InferInput(name, list(array.shape), datatype)
    made.set_data_from_numpy(array, binary_data=binary)
    return made


def of_scan(scan, *, binary, form=None):
    inputs = [
        tensor("points", "FP32", scan["points"], binary=binary),
        tensor("counts", "INT32", scan["n"].astype(np.int32), binary=binary),
        tensor("contact_id", "BYTES", np.array([b"%d" % n for n in scan["n"]], object), binary=binary),
        tensor("sensor_height_m", "FP64", np.full(len(scan["n"]), np.nan), binary=binary),
    ]
    outputs = [RequestedOutput(name, form) for name in NAMES]
    return InferRequest("shipshape", inputs, request_id="42", request_outputs=outputs)


def few_points():
    return InferRequest("shipshape", [tensor("points", "FP32", np.zeros((3, 3), np.float32), binary=True)])


async def over_rest(address, scan):
    url = f"http://{address}"
    async with InferenceRESTClient(RESTConfig(protocol="v2", retries=0)) as client:
        answers = []
        for binary in (True, False):
            request = of_scan(scan, binary=binary, form={"binary_data": binary})
            answers.append(listed(await client.infer(url, request, model_name="shipshape")))
        try:
            await client.infer(url, few_points(), model_name="shipshape")
        except httpx.HTTPStatusError as error:
            refusal = [str(error.response.status_code), str(error)]
        return {
            "live": await client.is_server_live(url),
            "ready": await client.is_server_ready(url),
            "model_ready": await client.is_model_ready(url, "shipshape"),
            "other_ready": await client.is_model_ready(url, "other"),
            "answers": answers,
            "refusals": [refusal],
        }


async def over_grpc(address, scan):
    async with InferenceGRPCClient(address, retries=0) as client:
        answers = [listed(await client.infer(of_scan(scan, binary=binary))) for binary in (True, False)]
        try:
            await client.infer(few_points())
        except grpc.RpcError as error:
            refusal = [str(error.code()), error.details()]
        try:
            other = await client.is_model_ready("other")
        except grpc.RpcError as error:
            other = error.code() is not grpc.StatusCode.NOT_FOUND
        return {
            "live": await client.is_server_live(),
            "ready": await client.is_server_ready(),
            "model_ready": await client.is_model_ready("shipshape"),
            "other_ready": other,
            "answers": answers,
            "refusals": [refusal],
        }


async def main():
    rest, grpc_address, path = sys.argv[1:]
    scan = np.load(path, allow_pickle=False)
    print(json.dumps({"rest": await over_rest(rest, scan), "grpc": await over_grpc(grpc_address, scan)}))


if __name__ == "__main__":
    asyncio.run(main())
