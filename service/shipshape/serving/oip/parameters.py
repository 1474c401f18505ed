"""Parameters of a request -> how to compute, and how long it may take."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, TypeVar

from shipshape.errors import InvalidInput
from shipshape.executor import Lane
from shipshape.serving.encoding import Wishes, make_wishes, to_float
from shipshape.types import ImageMethod, Options, Preset, Rung

T = TypeVar("T", bound=StrEnum)
PARAMETERS = (
    "preset",
    "image_method",
    "lowest_rung",
    "lane",
    "bundle",
    "captured_at",
    "max_age_ms",
    "timeout",
)
RAW_SIZE = "binary_data_size"  # of an input: the bytes of its raw data


def to_wishes(parameters: Mapping[str, Any], *, restored: bool) -> Wishes:
    """The wishes of a request; `restored`: it names an output of the restored clouds.

    Raises:
        InvalidInput: No such parameter, or a value that it cannot have.
    """
    check_known(parameters, PARAMETERS)
    default = Options()
    return make_wishes(
        options=Options(
            preset=_choice(Preset, parameters, "preset", default.preset),
            image_method=_choice(ImageMethod, parameters, "image_method", default.image_method),
            lowest_rung=_choice(Rung, parameters, "lowest_rung", default.lowest_rung),
        ),
        lane=_choice(Lane, parameters, "lane", Lane.TRACKING),
        captured_at=_number(parameters, "captured_at"),
        max_age_ms=_number(parameters, "max_age_ms"),
        bundle=_text(parameters, "bundle"),
        restored=restored,
    )


def timeout_s(parameters: Mapping[str, Any]) -> float | None:
    """Seconds of parameter timeout, which counts microseconds, as Triton's clients send it.

    Raises:
        InvalidInput: Not a whole number above 0.
    """
    if "timeout" not in parameters:
        return None
    value = parameters["timeout"]
    if not isinstance(value, int) or isinstance(value, bool) or value <= 0:
        raise InvalidInput(f"expected parameter timeout as whole microseconds above 0, got {value!r:.80}")
    return min(value, 10**15) / 1e6


def check_known(parameters: Mapping[str, Any], known: tuple[str, ...]) -> None:
    """Raises InvalidInput for a parameter that is not one of `known`."""
    for name in parameters:
        if name not in known:
            wanted = f"only parameters {', '.join(known)}" if known else "no parameters"
            raise InvalidInput(f"expected {wanted} here, got {name!r:.80}")


def _choice(kind: type[T], parameters: Mapping[str, Any], name: str, default: T) -> T:
    value = parameters.get(name, default)
    if value not in list(kind):
        raise InvalidInput(f"expected parameter {name} to be one of {', '.join(kind)}, got {value!r:.80}")
    return kind(value)


def _number(parameters: Mapping[str, Any], name: str) -> float | None:
    value = parameters.get(name)
    if name not in parameters:
        return None
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise InvalidInput(f"expected parameter {name} to be a number, got {value!r:.80}")
    return to_float(value)


def _text(parameters: Mapping[str, Any], name: str) -> str:
    value = parameters.get(name, "")
    if not isinstance(value, str):
        raise InvalidInput(f"expected parameter {name} to be a string, got {value!r:.80}")
    return value
