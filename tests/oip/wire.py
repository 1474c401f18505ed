"""The Open Inference Protocol by hand, written from its specification: no code of the service is used here."""

import json
import struct
from dataclasses import dataclass, field

import grpc
import numpy as np

from serving.fakes import PATIENCE
from shipshape.inference import open_inference_pb2 as pb
from shipshape.inference.open_inference_pb2_grpc import GRPCInferenceServiceStub

DATATYPES = {"float32": "FP32", "float64": "FP64", "int32": "INT32", "bool": "BOOL"}
NUMPY = {"FP32": "<f4", "FP64": "<f8", "INT32": "<i4", "BOOL": "?"}
CONTENTS = {
    "FP32": "fp32_contents",
    "FP64": "fp64_contents",
    "INT32": "int_contents",
    "BOOL": "bool_contents",
    "BYTES": "bytes_contents",
}
INFER = "/v2/models/shipshape/infer"
HEADER = "Inference-Header-Content-Length"


@dataclass
class Reply:
    """Outputs by name, numbers as arrays and BYTES as lists of text, or an error."""

    status: object
    outputs: dict = field(default_factory=dict)
    error: str = ""
    kind: str = ""
    fields: dict = field(default_factory=dict)
    headers: dict = field(default_factory=dict)


def described(value):
    """Data type and shape of an array, or of a list of bytes."""
    if isinstance(value, list):
        return "BYTES", [len(value)]
    return DATATYPES[value.dtype.name], list(value.shape)


def packed(value):
    if isinstance(value, list):
        return b"".join(struct.pack("<I", len(item)) + item for item in value)
    return value.astype(value.dtype.newbyteorder("<")).tobytes()


def unpacked(datatype, shape, raw):
    if datatype != "BYTES":
        return np.frombuffer(raw, NUMPY[datatype]).reshape(shape)
    items = []
    while raw:
        (length,) = struct.unpack_from("<I", raw)
        items.append(raw[4 : 4 + length].decode())
        raw = raw[4 + length :]
    assert shape == [len(items)]
    return items


def listed(value):
    """In JSON: flat, text for bytes, null for NaN."""
    if isinstance(value, list):
        return [item.decode() for item in value]
    return [None if number != number else number for number in value.reshape(-1).tolist()]  # noqa: PLR0124  NaN


def as_list(value):
    return {"data": listed(value)}


def as_raw(value):
    return {"parameters": {"binary_data_size": len(packed(value))}}


def envelope(inputs, outputs=(), parameters=None, *, content=as_list, **fields):
    """The JSON object of a request, its tensors as lists or as sizes of raw data."""
    tensors = []
    for name, value in inputs.items():
        datatype, shape = described(value)
        tensors.append({"name": name, "datatype": datatype, "shape": shape, **content(value)})
    body = {"inputs": tensors, **fields}
    if outputs:
        body["outputs"] = [{"name": name} for name in outputs]
    if parameters:
        body["parameters"] = parameters
    return body


def binary(inputs, outputs=(), parameters=None, **fields):
    """The body of a request with raw tensors behind the JSON, and how long the JSON is."""
    parameters = {"binary_data_output": True, **(parameters or {})}
    text = json.dumps(envelope(inputs, outputs, parameters, content=as_raw, **fields)).encode()
    return b"".join([text, *map(packed, inputs.values())]), len(text)


def by_json(doors, inputs, outputs=(), parameters=None, **fields):
    # httpx itself refuses to write infinity.
    return read(doors.rest.post(INFER, content=json.dumps(envelope(inputs, outputs, parameters, **fields))))


def by_binary(doors, inputs, outputs=(), parameters=None, **fields):
    body, size = binary(inputs, outputs, parameters, **fields)
    return read(doors.rest.post(INFER, content=body, headers={HEADER: str(size)}))


def read(response):
    """A REST response as a reply."""
    headers = dict(response.headers)
    size = headers.get(HEADER.lower())
    content = response.content
    body = json.loads(content[: int(size)] if size else content)
    if response.status_code != 200:
        return Reply(response.status_code, error=body["error"], kind=body["kind"], fields=body, headers=headers)
    behind = content[int(size) :] if size else b""
    outputs = {}
    for output in body.pop("outputs"):
        if "data" in output:
            value = output["data"]
            if output["datatype"] != "BYTES":
                value = np.array(value, NUMPY[output["datatype"]]).reshape(output["shape"])
        else:
            length = output["parameters"]["binary_data_size"]
            value, behind = unpacked(output["datatype"], output["shape"], behind[:length]), behind[length:]
        outputs[output["name"]] = value
    assert behind == b"", "all bytes belong to an output"
    return Reply(200, outputs, fields=body, headers=headers)


def message(inputs, outputs=(), parameters=None, *, raw=True, **fields):
    """The gRPC message of a request."""
    request = pb.ModelInferRequest(
        **{"model_name": "shipshape", **fields},
        outputs=[pb.ModelInferRequest.InferRequestedOutputTensor(name=name) for name in outputs],
    )
    for name, value in (parameters or {}).items():
        choice = {bool: "bool_param", int: "int64_param", float: "double_param", str: "string_param"}[type(value)]
        setattr(request.parameters[name], choice, value)
    for name, value in inputs.items():
        datatype, shape = described(value)
        tensor = request.inputs.add(name=name, datatype=datatype, shape=shape)
        if raw:
            request.raw_input_contents.append(packed(value))
        else:
            items = value if isinstance(value, list) else value.reshape(-1).tolist()
            getattr(tensor.contents, CONTENTS[datatype]).extend(items)
    return request


def call(doors, request, timeout=PATIENCE, metadata=()):
    """One ModelInfer as a reply; its outputs come as the inputs went, raw or not."""
    stub = GRPCInferenceServiceStub(doors.channel)
    rpc = stub.ModelInfer.future(request, timeout=timeout, metadata=metadata)
    if rpc.exception() is not None:
        trailing = dict(rpc.trailing_metadata())
        return Reply(rpc.code(), error=rpc.details(), kind=trailing.get("shipshape-error"), headers=trailing)
    answer, outputs = rpc.result(), {}
    for index, output in enumerate(answer.outputs):
        shape = list(output.shape)
        if request.raw_input_contents:
            outputs[output.name] = unpacked(output.datatype, shape, answer.raw_output_contents[index])
        elif output.datatype == "BYTES":
            outputs[output.name] = [item.decode() for item in output.contents.bytes_contents]
        else:
            values = getattr(output.contents, CONTENTS[output.datatype])
            outputs[output.name] = np.array(values, NUMPY[output.datatype]).reshape(shape)
    fields = {"model_name": answer.model_name, "model_version": answer.model_version, "id": answer.id}
    return Reply(grpc.StatusCode.OK, outputs, fields=fields, headers=dict(rpc.trailing_metadata()))


def by_grpc_raw(doors, inputs, outputs=(), parameters=None, **fields):
    return call(doors, message(inputs, outputs, parameters, **fields))


def by_grpc_typed(doors, inputs, outputs=(), parameters=None, **fields):
    return call(doors, message(inputs, outputs, parameters, raw=False, **fields))


FORMS = {"json": by_json, "binary": by_binary, "grpc_raw": by_grpc_raw, "grpc_typed": by_grpc_typed}


def scan(*clusters, **more):
    """Inputs of several clusters."""
    counts = np.array([len(points) for points in clusters], np.int32)
    return {"points": np.concatenate(clusters), "counts": counts, **more}
