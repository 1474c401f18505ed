"""What became of the contacts -> output tensors, one row a contact."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import Wishes
from shipshape.serving.faults import Fault
from shipshape.serving.model import Answer, Reply
from shipshape.serving.oip.convention import CONTACT_ID
from shipshape.serving.oip.tensors import NUMPY, Datatype, Tensor, TensorSpec
from shipshape.types import Recognition

NOT_DESCRIBED = np.empty((0, 5, 16, 32), np.uint8)


def _true_heading(found: Recognition) -> float:
    return math.nan if found.true_heading_deg is None else found.true_heading_deg


def _box(found: Recognition) -> list[float]:
    size = found.box.size
    return [*found.box.center_level, size.length, size.beam, size.height]


# Outputs with one row a contact; the row of a contact without an answer is NaN, false or empty.
COLUMNS: dict[TensorSpec, Callable[[Recognition], Any]] = {
    TensorSpec("vessel", Datatype.BYTES, (-1,)): lambda found: found.vessel,
    TensorSpec("probability", Datatype.FP64, (-1,)): lambda found: found.probability,
    TensorSpec("probabilities", Datatype.FP64, (-1, -1)): lambda found: list(found.probabilities.values()),
    TensorSpec("unknown", Datatype.BOOL, (-1,)): lambda found: found.unknown,
    TensorSpec("reasons", Datatype.BYTES, (-1,)): lambda found: ",".join(found.reasons),
    TensorSpec("heading", Datatype.FP64, (-1,)): lambda found: found.heading,
    TensorSpec("heading_std", Datatype.FP64, (-1,)): lambda found: found.heading_std,
    TensorSpec("bow_probability", Datatype.FP64, (-1,)): lambda found: found.bow_probability,
    TensorSpec("aspect_deg", Datatype.FP64, (-1,)): lambda found: found.aspect_deg,
    TensorSpec("true_heading_deg", Datatype.FP64, (-1,)): _true_heading,
    TensorSpec("box", Datatype.FP64, (-1, 6)): _box,
    TensorSpec("rung", Datatype.BYTES, (-1,)): lambda found: found.rung,
    TensorSpec("rung_reason", Datatype.BYTES, (-1,)): lambda found: found.rung_reason,
}
ERROR = TensorSpec("error", Datatype.BYTES, (-1,))
DETAIL = TensorSpec("detail", Datatype.BYTES, (-1,))
DEFAULT_OUTPUTS = [CONTACT_ID, *COLUMNS, ERROR, DETAIL]
RESTORED_POINTS = TensorSpec("restored_points", Datatype.FP32, (-1, 3))
RESTORED_MEASURED = TensorSpec("restored_measured", Datatype.BOOL, (-1,))
RESTORED_COUNTS = TensorSpec("restored_counts", Datatype.INT32, (-1,))
RESTORED = [RESTORED_POINTS, RESTORED_MEASURED, RESTORED_COUNTS]  # bulky: only when asked for
OUTPUTS = {spec.name: spec for spec in (*DEFAULT_OUTPUTS, *RESTORED)}


def output_specs(names: Sequence[str]) -> list[TensorSpec]:
    """The outputs that a request names, in its order; all but the restored clouds when it names none.

    Raises:
        InvalidInput: No such output, or one named twice.
    """
    for index, name in enumerate(names):
        if name not in OUTPUTS:
            raise InvalidInput(f"expected only outputs {', '.join(OUTPUTS)}, got {name!r:.80}")
        if name in names[:index]:
            raise InvalidInput(f"expected each output once, got {name} again")
    return [OUTPUTS[name] for name in names] or DEFAULT_OUTPUTS


def encode(answer: Answer, _: Wishes) -> Answer:
    """The answer without the images, which no output tells: less has to be handed over by the worker."""
    bare = replace(answer.recognition, images=None, descriptors=NOT_DESCRIBED)
    return replace(answer, recognition=bare)


def to_tensors(
    specs: Sequence[TensorSpec],
    contact_ids: Sequence[str],
    outcomes: Sequence[Reply[Answer] | Fault],
    classes: int,
) -> list[Tensor]:
    """The outputs `specs`; `classes` is how many columns the probabilities have."""
    faults = [outcome if isinstance(outcome, Fault) else None for outcome in outcomes]
    found = [None if isinstance(outcome, Fault) else outcome.content.recognition for outcome in outcomes]
    beside = {
        CONTACT_ID: contact_ids,
        ERROR: [fault.kind if fault else "" for fault in faults],
        DETAIL: [fault.message if fault else "" for fault in faults],
    }
    tensors: list[Tensor] = []
    for spec in specs:
        if spec in beside:
            tensors.append(_texts(spec, beside[spec]))
        elif spec in RESTORED:
            tensors.append(_restored(spec, found))
        else:
            tensors.append(_rows(spec, found, classes))
    return tensors


def _rows(spec: TensorSpec, found: Sequence[Recognition | None], classes: int) -> Tensor:
    of = COLUMNS[spec]
    if spec.datatype is Datatype.BYTES:
        return _texts(spec, ["" if one is None else of(one) for one in found])
    shape = (len(found), *(classes if size == -1 else size for size in spec.shape[1:]))
    values = np.full(shape, False if spec.datatype is Datatype.BOOL else math.nan, NUMPY[spec.datatype])
    for row, one in enumerate(found):
        if one is not None:
            values[row] = of(one)
    return Tensor(spec, shape, values.reshape(-1))


def _restored(spec: TensorSpec, found: Sequence[Recognition | None]) -> Tensor:
    clouds = [None if one is None else one.restored for one in found]
    if spec is RESTORED_COUNTS:
        counts = np.array([0 if cloud is None else len(cloud.measured) for cloud in clouds], NUMPY[spec.datatype])
        return Tensor(spec, counts.shape, counts)
    parts = [
        cloud.points_level if spec is RESTORED_POINTS else cloud.measured for cloud in clouds if cloud is not None
    ]
    values = np.concatenate([np.empty((0, *spec.shape[1:]), NUMPY[spec.datatype]), *parts])
    return Tensor(spec, values.shape, values.reshape(-1))


def _texts(spec: TensorSpec, texts: Sequence[str]) -> Tensor:
    return Tensor(spec, (len(texts),), [text.encode() for text in texts])
