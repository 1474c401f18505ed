"""Contacts and wishes -> messages of shipshape.v1, and its messages -> answers."""

from collections.abc import Sequence

import numpy as np

from shipshape.client.answers import Answer, Capacity, Info, Refusal
from shipshape.client.failures import error_of_contact
from shipshape.client.wishes import Wishes
from shipshape.errors import InvalidInput
from shipshape.quantised import quantise
from shipshape.types import (
    Box,
    Contact,
    ImageMethod,
    ImagePair,
    Preset,
    Reason,
    ReferenceBox,
    RestoredCloud,
    Rung,
)
from shipshape.v1 import shipshape_pb2 as pb


def from_contact(contact: Contact, step_m: float | None = None) -> pb.Contact:
    """The message of a contact, its points in float32, or in int16 steps of `step_m` metres.

    Points that no steps can tell go as they are, for the service to refuse.

    Raises:
        InvalidInput: Points of another shape, which the bytes of a message could not tell.
    """
    points = np.asarray(contact.points_level, np.float32)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidInput(f"expected points of shape (n, 3), got {points.shape}")
    message = pb.Contact(
        contact_id=contact.contact_id,
        sensor_height_m=contact.sensor_height,
        own_true_heading_deg=contact.own_true_heading_deg,
    )
    if step_m is not None and len(points) and np.isfinite(points).all():
        quantised = quantise(points, step_m)
        x, y, z = quantised.origin_level
        message.points_int16, message.scale = quantised.steps, quantised.scale
        message.origin.CopyFrom(pb.Point(x=x, y=y, z=z))
    else:
        message.points = points.astype("<f4").tobytes()
    return message


def from_wishes(wishes: Wishes) -> pb.Options:
    """The message of wishes."""
    return pb.Options(
        preset=f"PRESET_{wishes.preset.name}",
        image_method=f"IMAGE_METHOD_{wishes.image_method.name}",
        bundle=wishes.bundle,
        include_restored=wishes.restored,
        include_images=wishes.images,
        include_png=wishes.png,
        lane=f"LANE_{wishes.lane.name}",
        lowest_rung=f"RUNG_{wishes.lowest_rung.name}",
        captured_at=wishes.captured_at,
        max_age_ms=wishes.max_age_ms,
    )


def to_answer(message: pb.Recognition, endpoint: str) -> Answer:
    """What the service at `endpoint` said of one contact."""
    keypoints = [(point.x, point.y, point.z) for point in message.keypoints]
    return Answer(
        contact_id=message.contact_id,
        vessel=message.vessel,
        probability=message.probability,
        probabilities={each.name: each.probability for each in message.probabilities},
        unknown=message.unknown,
        reasons=_reasons(message.reasons),
        heading=message.heading,
        heading_std=message.heading_std,
        bow_probability=message.bow_probability,
        aspect_deg=message.aspect_deg,
        true_heading_deg=message.true_heading_deg if message.HasField("true_heading_deg") else None,
        box=_box(message.box),
        measured_points=message.measured_points,
        inferred_points=message.inferred_points,
        keypoints_level=np.array(keypoints, np.float32).reshape(-1, 3),
        rung=Rung(message.rung),
        rung_reason=message.rung_reason,
        preset=Preset(pb.Preset.Name(message.preset).removeprefix("PRESET_").lower()),
        image_method=_image_method(message.image_method),
        bundle=message.bundle,
        stage_ms={each.stage: each.milliseconds for each in message.stages},
        restored=_restored(message.restored) if message.HasField("restored") else None,
        images=_images(message.images) if message.HasField("images") else None,
        png=message.rendered_png if message.HasField("rendered_png") else None,
        endpoint=endpoint,
    )


def to_results(messages: Sequence[pb.ContactResult], endpoint: str) -> tuple[Answer | Refusal, ...]:
    """What the service at `endpoint` said of each contact of a scan."""
    return tuple(
        Refusal(each.contact_id, error_of_contact(each.error))
        if each.HasField("error")
        else to_answer(each.recognition, endpoint)
        for each in messages
    )


def to_capacity(message: pb.GetCapacityResponse) -> Capacity:
    """What a service would promise."""
    return Capacity(
        promises={Rung(each.rung): each.milliseconds / 1e3 for each in message.promises},
        wait_s=message.wait_ms / 1e3,
        load=(message.queue_depth + message.running) / max(1, message.workers),
        workers=message.workers,
        budget_s=message.budget.budget_ms / 1e3,
        level=message.budget.level,
    )


def to_info(message: pb.GetModelInfoResponse) -> Info:
    """What a service runs, and what it takes."""
    limits = message.limits
    return Info(
        message.version,
        message.bundle,
        message.bundle_name,
        limits.max_points,
        limits.max_contacts,
        limits.max_body_bytes,
    )


def _reasons(numbers: Sequence[int]) -> tuple[Reason, ...]:
    # One that a newer service knows and this client does not is passed over: the answer holds without it.
    known = {f"REASON_{reason.name}": reason for reason in Reason}
    names = (pb.Reason.Name(number) for number in numbers if number in pb.Reason.values())
    return tuple(known[name] for name in names if name in known)


def _image_method(number: int) -> ImageMethod | None:
    name = pb.ImageMethod.Name(number).removeprefix("IMAGE_METHOD_").lower() if number else ""
    return ImageMethod(name) if name else None


def _box(message: pb.Box) -> Box:
    center = message.center
    return Box((center.x, center.y, center.z), ReferenceBox(message.length, message.beam, message.height))


def _restored(message: pb.RestoredCloud) -> RestoredCloud:
    points = np.frombuffer(message.points, "<f4").reshape(-1, 3).astype(np.float32)
    return RestoredCloud(points, np.frombuffer(message.measured, np.uint8).astype(bool))


def _images(message: pb.ImagePair) -> ImagePair:
    return ImagePair(_image(message.before), _image(message.after))


def _image(message: pb.Image) -> np.ndarray:
    shape = (message.rows, message.columns, message.channels)
    return np.frombuffer(message.values, np.uint8).reshape(shape).copy()
