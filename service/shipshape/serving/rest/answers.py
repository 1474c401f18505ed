"""The core's values -> JSON, in the form that `schemas` promises."""

import base64
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np
import orjson
from jaxtyping import UInt8

from shipshape.budget import Report
from shipshape.serving.core import Capacity
from shipshape.serving.encoding import Limits, Wishes, flat_scores
from shipshape.serving.faults import Fault
from shipshape.serving.model import Answer, Model, Reply
from shipshape.serving.timing import Timeouts
from shipshape.types import Box, ImagePair, RestoredCloud

Json = dict[str, Any]


def to_bytes(value: Json) -> bytes:
    """The JSON text; numpy arrays become lists."""
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)


def from_answer(answer: Answer, wishes: Wishes) -> Json:
    """A `RecognitionAnswer`, with what the caller wished to see."""
    found = answer.recognition
    value: Json = {
        "contact_id": answer.contact.contact_id,
        "vessel": found.vessel,
        "probability": found.probability,
        "probabilities": dict(found.probabilities),
        "unknown": found.unknown,
        "reasons": list(found.reasons),
        "heading": found.heading,
        "heading_std": found.heading_std,
        "bow_probability": found.bow_probability,
        "aspect_deg": found.aspect_deg,
        "true_heading_deg": found.true_heading_deg,
        "box": _box(found.box),
        "measured_points": found.measured_points,
        "inferred_points": found.inferred_points,
        "keypoints": np.ascontiguousarray(found.keypoints_level),
        "rung": found.rung,
        "rung_reason": found.rung_reason,
        "preset": found.preset,
        "image_method": found.image_method,
        "bundle": found.bundle,
        "stage_ms": dict(found.stage_ms),
    }
    if wishes.restored:
        value["restored"] = _restored(found.restored)
    if wishes.images and found.images is not None:
        value["images"] = _images(found.images)
        value["descriptors"] = [_base64(_png(np.vstack(list(image)))) for image in found.descriptors]
    if answer.png is not None:
        value["rendered_png"] = _base64(answer.png)
    return value


def encode(answer: Answer, wishes: Wishes) -> bytes:
    """The JSON text of a `RecognitionAnswer`; on the worker."""
    return to_bytes(from_answer(answer, wishes))


def joined(contact_ids: Sequence[str], outcomes: Sequence[Reply[bytes] | Fault]) -> bytes:
    """The JSON text of a `ScanAnswer`, in the order of the contacts."""
    return b'{"results":[%s]}' % b",".join(map(_result, contact_ids, outcomes))


def _result(contact_id: str, outcome: Reply[bytes] | Fault) -> bytes:
    if isinstance(outcome, Fault):
        error: Json = {"error": outcome.kind, "detail": outcome.message}
        if outcome.retry_after_ms is not None:
            error["retry_after_ms"] = outcome.retry_after_ms
        return to_bytes({"contact_id": contact_id, "error": error})
    return b'{"contact_id":%s,"recognition":%s}' % (orjson.dumps(contact_id), outcome.content)


def from_model(model: Model, limits: Limits, timeouts: Timeouts) -> Json:
    """A `ModelAnswer`."""
    return {
        "version": version("shipshape"),
        "bundle_name": model.bundle.name,
        "bundle": model.bundle.digest,
        "catalogue": [
            {"name": entry.name, "length": entry.box.length, "beam": entry.box.beam, "height": entry.box.height}
            for entry in model.bundle.catalogue
        ],
        "scores": flat_scores(model.bundle.scores),
        "stages": [stage.name for stage in model.pipeline.stages],
        "limits": {
            "max_body_bytes": limits.max_body_bytes,
            "max_points": limits.max_points,
            "max_contacts": limits.max_contacts,
            "default_timeout_ms": timeouts.default_ms,
            "budget_ms": timeouts.budget_ms,
        },
    }


def from_capacity(capacity: Capacity, budget: Report) -> Json:
    """A `CapacityAnswer`."""
    return {
        "promises": [{"rung": rung, "milliseconds": seconds * 1e3} for rung, seconds in capacity.promises.items()],
        "wait_ms": capacity.wait_s * 1e3,
        "queue_depth": capacity.queue_depth,
        "running": capacity.running,
        "workers": capacity.workers,
        "budget": {
            "level": budget.level,
            "budget_ms": budget.budget_s * 1e3,
            "good": budget.good,
            "bad": budget.bad,
            "last_good_s": budget.last_good_s,
            "burn": budget.burn,
        },
    }


def _box(box: Box) -> Json:
    size = box.size
    return {"center": list(box.center_level), "length": size.length, "beam": size.beam, "height": size.height}


def _restored(cloud: RestoredCloud) -> Json:
    return {"points": np.ascontiguousarray(cloud.points_level), "measured": cloud.measured.tolist()}


def _images(images: ImagePair) -> Json:
    return {"before": _base64(_png(images.before)), "after": _base64(_png(images.after))}


def _png(image: UInt8[np.ndarray, "rows columns *colours"]) -> bytes:
    import cv2  # noqa: PLC0415  # on the worker alone: the service itself need not hold it

    written, encoded = cv2.imencode(".png", image)
    if not written:
        raise RuntimeError(f"cv2 could not encode an image of shape {image.shape}")
    return encoded.tobytes()


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")
