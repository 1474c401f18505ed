"""A trained network as a function of arrays; the only file that runs onnxruntime (`providers` says on what)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shipshape.errors import BundleError
from shipshape.micro_batches import Arrays, MicroBatches
from shipshape.providers import PROCESSOR, PROVIDERS, Provider, Runtime

_DTYPES = {
    "tensor(float)": "float32",
    "tensor(double)": "float64",
    "tensor(float16)": "float16",
    "tensor(uint8)": "uint8",
    "tensor(int32)": "int32",
    "tensor(int64)": "int64",
    "tensor(bool)": "bool",
}


@dataclass(frozen=True, slots=True)
class TensorSpec:
    """Name, shape (-1 marks a free dimension) and dtype of one input or output."""

    name: str
    shape: tuple[int, ...]
    dtype: str

    def __str__(self) -> str:
        return f"{self.name} {self.dtype}{list(self.shape)}"


@dataclass(frozen=True, slots=True)
class Signature:
    """What goes into a network and what comes out, in the order of the file."""

    inputs: tuple[TensorSpec, ...]
    outputs: tuple[TensorSpec, ...]


class OnnxModel:
    """A network on a GPU, or on one CPU thread: the executor already keeps every core busy with a contact each.

    Args:
        source: The ONNX file, or its bytes (hash the bytes first and nothing can change in between).
        signature: What the file must be; None takes the file's own.
        label: How error messages call it; by default the file's name.
        runtime: Where it runs. Calls share runs only if all inputs have rows: a free first dimension.

    Raises:
        BundleError: The file is missing, damaged, not of the promised signature, or does not run there.
    """

    _batches: MicroBatches | None = None

    def __init__(
        self,
        source: Path | bytes,
        signature: Signature | None = None,
        *,
        label: str = "",
        runtime: Runtime = PROCESSOR,
    ) -> None:
        label = label or (source.name if isinstance(source, Path) else "the model")
        self._label = label
        self._session = _open_session(source, label, runtime.provider)
        self.signature = _read_signature(self._session)
        if signature is not None:
            _compare(signature, self.signature, label)
        self._output_names = [spec.name for spec in self.signature.outputs]
        if runtime.micro_batches != "off" and all(spec.shape[:1] == (-1,) for spec in self.signature.inputs):
            measured = runtime.micro_batches == "auto"
            self._batches = MicroBatches(self._forward, label=label, buckets=runtime.buckets, measured=measured)

    @property
    def most_rows(self) -> int:
        """Rows up to which calls that meet become one run, if they are of one shape; 1 where none do."""
        return 1 if self._batches is None else self._batches.largest

    def run(self, **inputs: np.ndarray) -> list[np.ndarray]:
        """The outputs, in the order of the signature, for inputs of its names, shapes and dtypes.

        Raises:
            BundleError: The network does not take such inputs, so it is not the one that its caller was made for.
        """
        return self._forward(inputs) if self._batches is None else self._batches.run(inputs)

    def _forward(self, inputs: Arrays) -> list[np.ndarray]:
        try:
            outputs: list[np.ndarray] = self._session.run(self._output_names, inputs)
        except Exception as error:  # onnxruntime's own exceptions share no base class
            wanted = _listed(self.signature.inputs)
            given = ", ".join(f"{name} {array.dtype}{list(array.shape)}" for name, array in inputs.items())
            cause = " ".join(str(error).split())  # here too: an error loses its cause on its way out of a worker
            raise BundleError(
                f"expected {self._label} to take {given}, got a network for {wanted}, which says: {cause:.300}"
            ) from error
        return outputs


def _open_session(source: Path | bytes, label: str, provider: Provider) -> Any:
    content = source if isinstance(source, bytes) else _read(source, label)
    import onnxruntime  # noqa: PLC0415  # large, and the service computes in other processes

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL
    options.log_severity_level = 4  # errors reach the caller as exceptions; do not also write them to stderr
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.inter_op.allow_spinning", "0")
    try:
        session = onnxruntime.InferenceSession(
            content, options, providers=PROVIDERS[provider], enable_fallback=False
        )
    except Exception as error:  # onnxruntime's own exceptions share no base class
        failure = "parse as one" if provider is Provider.CPU else f"start on {provider} as one"
        raise BundleError(
            f"expected {label} to be a complete ONNX file, got {len(content)} bytes that do not {failure}"
        ) from error
    if (found := session.get_providers()[0]) != provider.full_name:  # it goes on without a word
        raise BundleError(f"expected {label} to run on {provider.full_name}, got {found}")
    return session


def _read(path: Path, label: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BundleError(f"expected to read the model file {label}, got: {error.strerror}") from error


def _read_signature(session: Any) -> Signature:
    return Signature(_specs(session.get_inputs()), _specs(session.get_outputs()))


def _specs(nodes: Sequence[Any]) -> tuple[TensorSpec, ...]:
    return tuple(
        TensorSpec(
            name=node.name,
            shape=tuple(size if isinstance(size, int) else -1 for size in node.shape),
            dtype=_DTYPES.get(node.type, node.type),
        )
        for node in nodes
    )


def _compare(expected: Signature, actual: Signature, label: str) -> None:
    sides: Mapping[str, tuple[tuple[TensorSpec, ...], tuple[TensorSpec, ...]]] = {
        "inputs": (expected.inputs, actual.inputs),
        "outputs": (expected.outputs, actual.outputs),
    }
    for side, (wanted, found) in sides.items():
        if wanted != found:
            raise BundleError(f"expected {label} to have the {side} {_listed(wanted)}, got {_listed(found)}")


def _listed(specs: Sequence[TensorSpec]) -> str:
    return ", ".join(map(str, specs)) or "none"
