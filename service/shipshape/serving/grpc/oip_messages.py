"""Messages of the Open Inference Protocol <-> its values."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from shipshape.errors import InvalidInput
from shipshape.inference import open_inference_pb2 as pb
from shipshape.serving.encoding import Limits
from shipshape.serving.oip.convention import check_header, find_input
from shipshape.serving.oip.inference import InferRequest
from shipshape.serving.oip.parameters import RAW_SIZE, check_known
from shipshape.serving.oip.tensors import Datatype, Tensor, from_raw, from_values, to_raw

CONTENTS = {
    Datatype.BOOL: "bool_contents",
    Datatype.INT32: "int_contents",
    Datatype.FP32: "fp32_contents",
    Datatype.FP64: "fp64_contents",
    Datatype.BYTES: "bytes_contents",
}


def to_request(message: pb.ModelInferRequest, limits: Limits) -> InferRequest:
    """The request of a message.

    Raises:
        InvalidInput: Tensors that are not the convention's, or contents that are not as their tensors say.
        TooLarge: More contacts than the limit.
    """
    raw = message.raw_input_contents
    if raw and len(raw) != len(message.inputs):
        raise InvalidInput(f"expected raw_input_contents of all {len(message.inputs)} inputs, got {len(raw)}")
    inputs: dict[str, Tensor] = {}
    for index, each in enumerate(message.inputs):
        spec = find_input(each.name, inputs)
        shape = check_header(spec, each.datatype, each.shape, limits)
        _check_parameters(each, len(raw[index]) if raw else None)
        if not raw:
            inputs[each.name] = from_values(spec, shape, _contents(each, spec.datatype))
        elif each.HasField("contents"):
            raise InvalidInput(f"expected one of contents and raw_input_contents of input {each.name}, got both")
        else:
            inputs[each.name] = from_raw(spec, shape, raw[index])
    for output in message.outputs:
        check_known(output.parameters, ())
    return InferRequest(inputs, [output.name for output in message.outputs], dict(_parameters(message.parameters)))


def from_tensors(tensors: Sequence[Tensor], *, raw: bool) -> pb.ModelInferResponse:
    """The message of the outputs; the model's name and version are the servicer's to add."""
    message = pb.ModelInferResponse()
    for tensor in tensors:
        output = message.outputs.add(name=tensor.spec.name, datatype=tensor.spec.datatype, shape=tensor.shape)
        if raw:
            message.raw_output_contents.append(to_raw(tensor))
        else:
            values = tensor.values if isinstance(tensor.values, list) else tensor.values.tolist()
            getattr(output.contents, CONTENTS[tensor.spec.datatype]).extend(values)
    return message


def _check_parameters(tensor: pb.ModelInferRequest.InferInputTensor, raw_size: int | None) -> None:
    """KServe's client repeats the size of raw data, which belongs to REST."""
    given = dict(_parameters(tensor.parameters))
    check_known(given, (RAW_SIZE,))
    if RAW_SIZE in given and given[RAW_SIZE] != raw_size:
        raise InvalidInput(
            f"expected {RAW_SIZE} of input {tensor.name} as in raw_input_contents, got {given[RAW_SIZE]!r:.40}"
        )


def _contents(tensor: pb.ModelInferRequest.InferInputTensor, datatype: Datatype) -> Sequence[Any]:
    filled = [field.name for field, _ in tensor.contents.ListFields()]
    if filled not in ([], [CONTENTS[datatype]]):
        raise InvalidInput(
            f"expected only {CONTENTS[datatype]} in contents of input {tensor.name}, got {' and '.join(filled)}"
        )
    values: Sequence[Any] = getattr(tensor.contents, CONTENTS[datatype])
    return values


def _parameters(parameters: Mapping[str, pb.InferParameter]) -> Iterator[tuple[str, Any]]:
    for name, value in parameters.items():
        choice = value.WhichOneof("parameter_choice")
        yield name, None if choice is None else getattr(value, choice)
