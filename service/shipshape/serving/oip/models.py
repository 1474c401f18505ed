"""The server and its one model, as the protocol names and describes them."""

from importlib.metadata import version
from typing import Any

from shipshape.bundle import UNKNOWN
from shipshape.errors import InvalidInput
from shipshape.serving.core import Core
from shipshape.serving.encoding import Limits
from shipshape.serving.model import Model
from shipshape.serving.oip import convention, results
from shipshape.serving.oip.parameters import PARAMETERS
from shipshape.serving.oip.tensors import TensorSpec

NAME = "shipshape"  # of the server and of its model
VERSION_DIGITS = 12  # of the bundle's digest
PLATFORM = "onnx_onnxv1"  # of those that the protocol lists
EXTENSIONS = ["binary_tensor_data"]  # Triton's name for raw tensors behind the JSON


class UnknownModel(InvalidInput):
    """Another model, or another version of it, than the running one: not found."""


def check_name(name: str) -> None:
    """Raises UnknownModel when `name` is not the model's."""
    if name != NAME:
        raise UnknownModel(f"expected model {NAME}, got {name!r:.80}")


def find_model(core: Core, name: str, wanted: str) -> Model:
    """The running model, if `name` and `wanted` name it; an empty version is whichever runs.

    Raises:
        UnknownModel: They do not.
        NotReady: The service is starting or stopping.
    """
    check_name(name)
    model = core.model()
    if wanted not in ("", version_of(model)):
        raise UnknownModel(f"expected version {version_of(model)} of model {NAME}, got {wanted!r:.80}")
    return model


def version_of(model: Model) -> str:
    """The version of a model: what its bundle's digest begins with."""
    return model.bundle.digest[:VERSION_DIGITS]


def classes_of(model: Model) -> list[str]:
    """What the columns of output probabilities are of."""
    return [*(entry.name for entry in model.bundle.catalogue), UNKNOWN]


def server_metadata() -> dict[str, Any]:
    """The fields of the protocol's server metadata."""
    return {"name": NAME, "version": version("shipshape"), "extensions": EXTENSIONS}


def model_metadata(model: Model, limits: Limits) -> dict[str, Any]:
    """The fields of the protocol's model metadata."""
    classes = classes_of(model)
    return {
        "name": NAME,
        "versions": [version_of(model)],
        "platform": PLATFORM,
        "inputs": [_described(spec, len(classes)) for spec in convention.INPUTS.values()],
        "outputs": [_described(spec, len(classes)) for spec in results.OUTPUTS.values()],
        "properties": {
            "convention": convention.TEXT,
            "optional_inputs": ",".join(convention.OPTIONAL_INPUTS),
            "outputs_on_request": ",".join(spec.name for spec in results.RESTORED),
            "parameters": ",".join(PARAMETERS),
            "classes": ",".join(classes),
            "bundle": model.bundle.digest,
            "max_body_bytes": str(limits.max_body_bytes),
            "max_points": str(limits.max_points),
            "max_contacts": str(limits.max_contacts),
        },
    }


def _described(spec: TensorSpec, classes: int) -> dict[str, Any]:
    shape = [spec.shape[0], *(classes if size == -1 else size for size in spec.shape[1:])]
    return {"name": spec.name, "datatype": str(spec.datatype), "shape": shape}
