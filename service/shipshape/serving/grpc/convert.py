"""Messages of shipshape.v1 <-> the core's own values; units and frames are the same on both sides."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import StrEnum
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float32, UInt8

from shipshape.budget import Report
from shipshape.errors import InvalidInput
from shipshape.executor import Lane
from shipshape.serving.core import Capacity
from shipshape.serving.encoding import (
    Limits,
    Wishes,
    flat_scores,
    make_contact,
    make_wishes,
    pack,
    points_from_bytes,
)
from shipshape.serving.encoding_int16 import points_from_int16
from shipshape.serving.faults import Fault, FaultKind
from shipshape.serving.model import Answer, Model, Reply
from shipshape.types import Box, Contact, ImageMethod, Options, Preset, Reason, RestoredCloud, Rung
from shipshape.v1 import shipshape_pb2 as pb

T = TypeVar("T", bound=StrEnum)

PRESETS = {pb.PRESET_PAPER: Preset.PAPER, pb.PRESET_BEST: Preset.BEST}
IMAGE_METHODS = {
    pb.IMAGE_METHOD_FULL_TOP: ImageMethod.FULL_TOP,
    pb.IMAGE_METHOD_FULL_SIDE: ImageMethod.FULL_SIDE,
    pb.IMAGE_METHOD_Z_TOP: ImageMethod.Z_TOP,
    pb.IMAGE_METHOD_Z_SIDE: ImageMethod.Z_SIDE,
}
LANES = {pb.LANE_COLLISION: Lane.COLLISION, pb.LANE_TRACKING: Lane.TRACKING, pb.LANE_BATCH: Lane.BATCH}
RUNGS = {
    pb.RUNG_FULL: Rung.FULL,
    pb.RUNG_WITHOUT_RESTORATION: Rung.WITHOUT_RESTORATION,
    pb.RUNG_HEADING_AND_BOX: Rung.HEADING_AND_BOX,
}
REASONS = {reason: f"REASON_{reason.name}" for reason in Reason}
ERROR_KINDS = {kind: f"ERROR_KIND_{kind.name}" for kind in FaultKind}
_PRESET_NUMBERS = {preset: number for number, preset in PRESETS.items()}
_IMAGE_METHOD_NUMBERS = {method: number for number, method in IMAGE_METHODS.items()}


def to_contact(message: pb.Contact, limits: Limits) -> Contact:
    """The contact of a message; raises InvalidInput for what `encoding` refuses."""
    return make_contact(
        _points(message, limits),
        contact_id=message.contact_id,
        sensor_height_m=message.sensor_height_m if message.HasField("sensor_height_m") else None,
        own_true_heading_deg=message.own_true_heading_deg if message.HasField("own_true_heading_deg") else None,
    )


def to_contacts(messages: Sequence[pb.Contact], limits: Limits) -> list[Contact | InvalidInput]:
    """The contacts of a scan, an error in the place of each that cannot be decoded."""
    contacts: list[Contact | InvalidInput] = []
    for message in messages:
        try:
            contacts.append(to_contact(message, limits))
        except InvalidInput as error:
            contacts.append(error)
    return contacts


def to_wishes(message: pb.Options) -> Wishes:
    """The wishes of a message.

    Raises:
        InvalidInput: A number that the contract does not know, or an age that cannot be.
    """
    usual = Options()
    options = Options(
        _numbered(PRESETS, message.preset, "preset", usual.preset),
        _numbered(IMAGE_METHODS, message.image_method, "image_method", usual.image_method),
        _numbered(RUNGS, message.lowest_rung, "lowest_rung", usual.lowest_rung),
    )
    return make_wishes(
        options=options,
        lane=to_lane(message.lane),
        captured_at=message.captured_at if message.HasField("captured_at") else None,
        max_age_ms=message.max_age_ms if message.HasField("max_age_ms") else None,
        bundle=message.bundle,
        restored=message.include_restored,
        images=message.include_images,
        png=message.include_png,
    )


def from_answer(answer: Answer, wishes: Wishes) -> pb.Recognition:
    """The message of an answer, with what the caller wished to see."""
    found = answer.recognition
    message = pb.Recognition(
        contact_id=answer.contact.contact_id,
        vessel=found.vessel,
        probability=found.probability,
        probabilities=[pb.NamedProbability(name=n, probability=p) for n, p in found.probabilities.items()],
        unknown=found.unknown,
        reasons=[REASONS[reason] for reason in found.reasons],
        heading=found.heading,
        heading_std=found.heading_std,
        bow_probability=found.bow_probability,
        aspect_deg=found.aspect_deg,
        true_heading_deg=found.true_heading_deg,
        box=_box(found.box),
        measured_points=found.measured_points,
        inferred_points=found.inferred_points,
        keypoints=[pb.Point(x=x, y=y, z=z) for x, y, z in found.keypoints_level.tolist()],
        rung=found.rung,
        rung_reason=found.rung_reason,
        preset=_PRESET_NUMBERS[found.preset],
        image_method=_IMAGE_METHOD_NUMBERS[found.image_method] if found.image_method else None,
        bundle=found.bundle,
        stages=from_stage_ms(found.stage_ms),
        rendered_png=answer.png,
    )
    if wishes.restored:
        message.restored.CopyFrom(_restored(found.restored))
    if wishes.images and found.images is not None:
        images = pb.ImagePair(before=_image(found.images.before), after=_image(found.images.after))
        message.images.CopyFrom(images)
        message.descriptors.extend(map(_image, np.moveaxis(found.descriptors, 1, -1)))
    return message


def encode_single(answer: Answer, wishes: Wishes) -> bytes:
    """The bytes of a RecogniseResponse; on the worker."""
    return pb.RecogniseResponse(recognition=from_answer(answer, wishes)).SerializeToString()


def encode_in_scan(answer: Answer, wishes: Wishes) -> bytes:
    """The bytes of a RecogniseScanResponse with this result alone; on the worker."""
    return pb.RecogniseScanResponse(results=[_result(answer, wishes)]).SerializeToString()


def encode_in_stream(answer: Answer, wishes: Wishes) -> bytes:
    """The bytes of a RecogniseStreamResponse with this result alone; on the worker."""
    return pb.RecogniseStreamResponse(results=[_result(answer, wishes)]).SerializeToString()


def joined(
    response: Callable[..., Any], contact_ids: Iterable[str], outcomes: Sequence[Reply[bytes] | Fault]
) -> bytes:
    """The bytes of one `response` with the results of all outcomes, in the order of the contacts.

    The bytes of messages one after the other are those of the message with the repeated fields of all.
    """
    parts = []
    for contact_id, outcome in zip(contact_ids, outcomes, strict=True):
        if isinstance(outcome, Fault):
            result = pb.ContactResult(contact_id=contact_id, error=from_fault(outcome))
            parts.append(response(results=[result]).SerializeToString())
        else:
            parts.append(outcome.content)
    return b"".join(parts)


def _result(answer: Answer, wishes: Wishes) -> pb.ContactResult:
    return pb.ContactResult(contact_id=answer.contact.contact_id, recognition=from_answer(answer, wishes))


def from_fault(fault: Fault) -> pb.ContactError:
    """The message of a fault."""
    return pb.ContactError(
        kind=ERROR_KINDS[fault.kind], message=fault.message, retry_after_ms=fault.retry_after_ms
    )


def from_stage_ms(stage_ms: Mapping[str, float]) -> list[pb.StageTime]:
    """The messages of each stage's milliseconds."""
    return [pb.StageTime(stage=stage, milliseconds=ms) for stage, ms in stage_ms.items()]


def from_model(model: Model, version: str) -> pb.GetModelInfoResponse:
    """The message of a model; the limits are the servicer's to add."""
    return pb.GetModelInfoResponse(
        version=version,
        bundle_name=model.bundle.name,
        bundle=model.bundle.digest,
        catalogue=[
            pb.CatalogueVessel(
                name=entry.name, length=entry.box.length, beam=entry.box.beam, height=entry.box.height
            )
            for entry in model.bundle.catalogue
        ],
        scores=flat_scores(model.bundle.scores),
        stages=[stage.name for stage in model.pipeline.stages],
    )


def from_capacity(capacity: Capacity, budget: Report) -> pb.GetCapacityResponse:
    """The message of what would be promised."""
    return pb.GetCapacityResponse(
        promises=[
            pb.Promise(rung=rung, milliseconds=seconds * 1e3) for rung, seconds in capacity.promises.items()
        ],
        wait_ms=capacity.wait_s * 1e3,
        queue_depth=capacity.queue_depth,
        running=capacity.running,
        workers=capacity.workers,
        budget=pb.Budget(
            level=budget.level,
            budget_ms=budget.budget_s * 1e3,
            good=budget.good,
            bad=budget.bad,
            last_good_s=budget.last_good_s,
            burn=budget.burn,
        ),
    )


def to_lane(number: int) -> Lane:
    """The lane of its number; raises InvalidInput for one that the contract does not know."""
    return _numbered(LANES, number, "lane", Lane.TRACKING)


def _points(message: pb.Contact, limits: Limits) -> Float32[np.ndarray, "n 3"]:
    if not message.points_int16:
        return points_from_bytes(message.points, limits)
    if message.points:
        raise InvalidInput("expected one of points and points_int16, got both")
    origin = message.origin
    return points_from_int16(message.points_int16, (origin.x, origin.y, origin.z), message.scale, limits)


def _box(box: Box) -> pb.Box:
    x, y, z = box.center_level
    return pb.Box(
        center=pb.Point(x=x, y=y, z=z), length=box.size.length, beam=box.size.beam, height=box.size.height
    )


def _restored(cloud: RestoredCloud) -> pb.RestoredCloud:
    return pb.RestoredCloud(points=pack(cloud.points_level), measured=cloud.measured.tobytes())


def _image(image: UInt8[np.ndarray, "rows columns channels"]) -> pb.Image:
    rows, columns, channels = image.shape
    return pb.Image(rows=rows, columns=columns, channels=channels, values=image.tobytes())


def _numbered(table: Mapping[Any, T], number: int, what: str, unspecified: T) -> T:
    if number == 0:
        return unspecified
    if number not in table:
        raise InvalidInput(f"expected {what} to be one of {', '.join(table.values())}, got number {number}")
    return table[number]
