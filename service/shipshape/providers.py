"""Where networks run: on the processor, or on an accelerator that is asked for or found."""

import contextlib
import io
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from importlib.metadata import distributions
from typing import Any, Literal

from shipshape.errors import SettingsError
from shipshape.micro_batches import BUCKETS

GPU_PACKAGE = "onnxruntime-gpu"
_SILENT, _WARNINGS = 4, 2  # onnxruntime's levels; the second is its default
_logger = logging.getLogger(__name__)


class Provider(StrEnum):
    """One of onnxruntime's execution providers."""

    CPU = "cpu"
    CUDA = "cuda"

    @property
    def full_name(self) -> str:
        """As onnxruntime calls it."""
        return f"{self.upper()}ExecutionProvider"


# What sessions are opened with. With the 10 bits of TF32, answers would no longer be the processor's. To try out
# all ways of computing a convolution, as is the default, would take seconds for every new shape.
PROVIDERS: Mapping[Provider, list[Any]] = {
    Provider.CPU: [Provider.CPU.full_name],
    Provider.CUDA: [
        (Provider.CUDA.full_name, {"use_tf32": "0", "cudnn_conv_algo_search": "HEURISTIC"}),
        Provider.CPU.full_name,
    ],
}


@dataclass(frozen=True, slots=True)
class Runtime:
    """Where the networks of a bundle run, and whether calls that meet share runs (`micro_batches`).

    `auto` shares them as far as it is measured to pay.
    """

    provider: Provider = Provider.CPU
    micro_batches: Literal["auto", "on", "off"] = "off"
    buckets: tuple[int, ...] = BUCKETS


PROCESSOR = Runtime()

# A network x -> x of one float32: the smallest that shows whether a provider starts.
_IDENTITY = bytes.fromhex(
    "080912003a370a100a017812017922084964656e746974791201675a0f0a0178120a0a08080112040a020801620f0a0179120a0a08080112"
    "040a02080142040a001011"
)


def find_provider(wanted: Literal["auto", "cpu", "cuda"]) -> Provider:
    """The provider that was asked for; with `auto` CUDA where it works, else the processor.

    Raises:
        SettingsError: CUDA was asked for and does not work here.
    """
    if wanted == "cpu":
        return Provider.CPU
    if wanted == "auto" and not any(distributions(name=GPU_PACKAGE)):
        return Provider.CPU
    import onnxruntime  # noqa: PLC0415  # large, and the service computes in other processes

    offered = Provider.CUDA.full_name in onnxruntime.get_available_providers()
    obstacle = _obstacle_to_cuda() if offered else "an onnxruntime without CUDA"
    if obstacle is None:
        return Provider.CUDA
    if wanted == "cuda":
        raise SettingsError(f"expected CUDA to work, got {obstacle}; docs/gpu.md says what it needs")
    if offered:
        _logger.warning("networks run on the processor: expected CUDA to work, got %s", obstacle)
    return Provider.CPU


def _obstacle_to_cuda() -> str | None:
    import onnxruntime  # noqa: PLC0415  # large, and the service computes in other processes

    with contextlib.redirect_stdout(io.StringIO()):  # it prints what it does not find
        onnxruntime.preload_dlls()
    # That a provider is offered does not mean that it starts: without a driver, a card or a library, onnxruntime
    # writes to stderr and goes on with the processor.
    onnxruntime.set_default_logger_severity(_SILENT)
    try:
        session = onnxruntime.InferenceSession(
            _IDENTITY, providers=PROVIDERS[Provider.CUDA], enable_fallback=False
        )
    except Exception as error:  # onnxruntime's own exceptions share no base class
        return " ".join(str(error).split())[:160]
    finally:
        onnxruntime.set_default_logger_severity(_WARNINGS)
    if session.get_providers()[0] != Provider.CUDA.full_name:
        return "an onnxruntime that finds no usable GPU, driver, CUDA or cuDNN"
    return None
