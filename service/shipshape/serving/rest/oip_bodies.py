"""Bodies of the Open Inference Protocol over REST <-> its values: JSON, with raw tensors behind it where wished.

The raw tensors are Triton's binary tensor data extension: a header tells where the JSON ends, parameter
binary_data_size of a tensor how many of the bytes behind it are its own, in the order of the tensors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from types import NoneType
from typing import Any

import numpy as np
import orjson
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import from_json

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import Limits
from shipshape.serving.oip.convention import check_header, find_input
from shipshape.serving.oip.inference import InferRequest
from shipshape.serving.oip.models import NAME
from shipshape.serving.oip.parameters import RAW_SIZE, check_known
from shipshape.serving.oip.tensors import Datatype, Tensor, from_raw, from_values, to_raw
from shipshape.serving.rest.requests import sentence

JSON_BYTES_HEADER = "Inference-Header-Content-Length"
RAW_OUTPUT, RAW_OUTPUTS = "binary_data", "binary_data_output"
# By type, not by what numpy makes of it: true and false would become 1 and 0 among numbers.
ELEMENTS: dict[Datatype, set[type]] = {
    Datatype.BYTES: {str},
    Datatype.INT32: {int},
    Datatype.FP32: {int, float, NoneType},
    Datatype.FP64: {int, float, NoneType},
}


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class InputBody(_Strict):
    """The protocol's request_input."""

    name: str
    datatype: str
    shape: list[int]
    parameters: dict[str, Any] | None = None
    data: Any = None  # its elements are checked by type, all at once


class OutputBody(_Strict):
    """The protocol's request_output."""

    name: str
    parameters: dict[str, Any] | None = None


class InferBody(_Strict):
    """The protocol's inference_request; the model's name may stand beside it, as KServe's client puts it."""

    inputs: list[InputBody]
    outputs: list[OutputBody] | None = None
    parameters: dict[str, Any] | None = None
    id: str | None = None
    model_name: str | None = None


@dataclass(frozen=True, slots=True)
class Asked:
    """A request, and the form in which its caller wants the answer."""

    request: InferRequest
    id: str | None
    raw_outputs: frozenset[str] | None  # names of outputs wished as raw data; None: all of them


def parse_infer(body: bytes, json_bytes: str, limits: Limits) -> Asked:
    """The request of a body.

    Args:
        body: The JSON, and the raw tensors behind it.
        json_bytes: How many of them are JSON, from `json_end`.
        limits: Bound the contacts.

    Raises:
        InvalidInput: Not the protocol's form, or tensors that are not the convention's.
        TooLarge: More contacts than the limit.
    """
    end = int(json_bytes)
    envelope = _envelope(body[:end])
    if envelope.model_name not in (None, NAME):
        raise InvalidInput(f"expected the model's name of the path, {NAME}, got {envelope.model_name!r:.80}")
    parameters = dict(envelope.parameters or {})
    all_raw = _flag(parameters, RAW_OUTPUTS, default=False)
    raw = {output.name: _wants_raw(output, all_raw) for output in envelope.outputs or []}
    request = InferRequest(_inputs(envelope.inputs, memoryview(body)[end:], limits), list(raw), parameters)
    if envelope.outputs and len(raw) < len(envelope.outputs):
        raise InvalidInput("expected each output once, got one of them again")
    raw_outputs = frozenset(name for name in raw if raw[name])
    return Asked(request, envelope.id, None if all_raw and not raw else raw_outputs)


def json_end(body: bytes, json_bytes: str | None) -> int:
    """How many bytes of a body are JSON.

    Args:
        body: All of it.
        json_bytes: The header that says so; None: there is none, and all of the body is.

    Raises:
        InvalidInput: The header is no such number.
    """
    if json_bytes is None:
        return len(body)
    digits = json_bytes.isascii() and json_bytes.isdecimal() and len(json_bytes) <= 20
    if not digits or int(json_bytes) > len(body):
        raise InvalidInput(f"expected {JSON_BYTES_HEADER} of 0 to {len(body)}, got {json_bytes!r:.40}")
    return int(json_bytes)


def write_answer(fields: Mapping[str, Any], tensors: Sequence[Tensor], asked: Asked) -> tuple[bytes, int | None]:
    """The body of an answer.

    Args:
        fields: What stands beside the outputs.
        tensors: The outputs.
        asked: Says which of them are raw.

    Returns:
        The bytes, and how many of them are JSON when raw tensors follow.
    """
    raw: list[bytes] = []
    outputs: list[dict[str, Any]] = []
    for tensor in tensors:
        name = tensor.spec.name
        output: dict[str, Any] = {"name": name, "datatype": tensor.spec.datatype, "shape": tensor.shape}
        if asked.raw_outputs is None or name in asked.raw_outputs:
            raw.append(to_raw(tensor))
            output["parameters"] = {RAW_SIZE: len(raw[-1])}
        else:
            output["data"] = _listed(tensor)
        outputs.append(output)
    echoed = {} if asked.id is None else {"id": asked.id}
    text = orjson.dumps({**fields, **echoed, "outputs": outputs}, option=orjson.OPT_SERIALIZE_NUMPY)
    return b"".join([text, *raw]), len(text) if raw else None


def _envelope(text: bytes) -> InferBody:
    try:
        return InferBody.model_validate(from_json(text, allow_inf_nan=True))
    except ValidationError as error:
        raise InvalidInput(sentence(error)) from error
    except ValueError as error:
        raise InvalidInput(f"expected JSON, got {len(text)} bytes that are not: {error}") from error


def _inputs(bodies: Sequence[InputBody], behind: memoryview, limits: Limits) -> dict[str, Tensor]:
    inputs: dict[str, Tensor] = {}
    at = 0
    for body in bodies:
        spec = find_input(body.name, inputs)
        shape = check_header(spec, body.datatype, body.shape, limits)
        parameters = body.parameters or {}
        check_known(parameters, (RAW_SIZE,))
        if RAW_SIZE in parameters:
            size = _raw_size(body, len(behind) - at)
            inputs[body.name] = from_raw(spec, shape, bytes(behind[at : at + size]))
            at += size
        else:
            inputs[body.name] = from_values(spec, shape, _flat(body, shape, ELEMENTS[spec.datatype]))
    if at != len(behind):
        raise InvalidInput(f"expected {at} bytes behind the JSON, as the inputs say, got {len(behind)}")
    return inputs


def _raw_size(body: InputBody, left: int) -> int:
    size = (body.parameters or {})[RAW_SIZE]
    if body.data is not None:
        raise InvalidInput(f"expected one of data and {RAW_SIZE} of input {body.name}, got both")
    if not isinstance(size, int) or isinstance(size, bool) or not 0 <= size <= left:
        raise InvalidInput(
            f"expected {RAW_SIZE} of input {body.name} from 0 to the {left} bytes that are left behind the JSON, "
            f"got {size!r:.40}"
        )
    return size


def _flat(body: InputBody, shape: tuple[int, ...], types: set[type]) -> list[Any]:
    data = body.data
    if not isinstance(data, list):
        raise InvalidInput(f"expected data of input {body.name} as a list, got {data!r:.40}")
    if data and isinstance(data[0], list):
        for inner in shape[1:]:
            if not all(isinstance(row, list) and len(row) == inner for row in data):
                raise InvalidInput(
                    f"expected data of input {body.name} flat or in lists as its shape, got other lists"
                )
            data = list(chain.from_iterable(data))
    if not set(map(type, data)) <= types:
        wanted = "strings" if str in types else "integers" if float not in types else "numbers"
        raise InvalidInput(f"expected only {wanted} in data of input {body.name}, got something else among them")
    return [item.encode() for item in data] if str in types else data


def _wants_raw(output: OutputBody, default: bool) -> bool:
    parameters = dict(output.parameters or {})
    wanted = _flag(parameters, RAW_OUTPUT, default=default)
    check_known(parameters, (RAW_OUTPUT,))
    return wanted


def _flag(parameters: dict[str, Any], name: str, *, default: bool) -> bool:
    value = parameters.pop(name, default)
    if not isinstance(value, bool):
        raise InvalidInput(f"expected parameter {name} to be true or false, got {value!r:.40}")
    return value


def _listed(tensor: Tensor) -> Any:
    """The elements in JSON: text for BYTES, null for NaN."""
    if isinstance(tensor.values, list):
        return [item.decode() for item in tensor.values]
    return np.ascontiguousarray(tensor.values)
