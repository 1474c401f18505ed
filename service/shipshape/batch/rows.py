"""The table that a run writes: its columns, and a recognition as a row of it.

Metres and radians, level frame, except where a name says otherwise; docs/batch.md says what each column is.
Columns may be added under the same version; a change of what one means is another version.
"""

from typing import Any

import pyarrow as pa

from shipshape.batch.units import Chunk, Cloud, unit_id
from shipshape.client import Answer
from shipshape.types import Recognition, RestoredCloud

VERSION = "1"

_TEXT, _NUMBER = pa.string(), pa.float64()
COLUMNS = pa.schema(
    [
        pa.field("unit", _TEXT, nullable=False),
        pa.field("input_sha256", _TEXT, nullable=False),
        pa.field("message", pa.int64(), nullable=False),
        pa.field("cluster", pa.int32()),
        pa.field("topic", _TEXT),
        pa.field("frame_id", _TEXT),
        pa.field("stamp", pa.timestamp("ns", tz="UTC")),
        pa.field("contact_id", _TEXT),
        pa.field("points", pa.int32(), nullable=False),
        pa.field("sensor_height", _NUMBER),
        pa.field("error", _TEXT),
        pa.field("vessel", _TEXT),
        pa.field("probability", _NUMBER),
        pa.field("unknown", pa.bool_()),
        pa.field("probabilities", pa.map_(_TEXT, _NUMBER)),
        pa.field("reasons", pa.list_(_TEXT)),
        pa.field("heading", _NUMBER),
        pa.field("heading_std", _NUMBER),
        pa.field("bow_probability", _NUMBER),
        pa.field("aspect_deg", _NUMBER),
        pa.field("true_heading_deg", _NUMBER),
        pa.field("box_x", _NUMBER),
        pa.field("box_y", _NUMBER),
        pa.field("box_z", _NUMBER),
        pa.field("length", _NUMBER),
        pa.field("beam", _NUMBER),
        pa.field("height", _NUMBER),
        pa.field("measured_points", pa.int32()),
        pa.field("inferred_points", pa.int32()),
        pa.field("preset", _TEXT),
        pa.field("image_method", _TEXT),
        pa.field("bundle", _TEXT, nullable=False),
        pa.field("code", _TEXT, nullable=False),
    ],
    metadata={"shipshape.batch.schema": VERSION},
)
INPUT = pa.field("input", _TEXT, nullable=False)  # its name, which a part does not know: files are renamed
STAGE_MS = pa.field("stage_ms", pa.map_(_TEXT, _NUMBER))  # apart: the only column that differs from run to run
CONTACTS = COLUMNS.insert(0, INPUT)
TIMINGS = pa.schema([COLUMNS.field("unit"), STAGE_MS], metadata=COLUMNS.metadata)
PART = COLUMNS.append(STAGE_MS)
CLOUDS = pa.schema(
    [
        COLUMNS.field("unit"),
        *(pa.field(axis, pa.list_(pa.float32()), nullable=False) for axis in "xyz"),
        pa.field("measured", pa.list_(pa.bool_()), nullable=False),
    ],
    metadata=COLUMNS.metadata,
)


def row_of(
    chunk: Chunk, cloud: Cloud, sensor_height: float | None, answer: Recognition | Answer | str
) -> dict[str, Any]:
    """A row but for `bundle` and `code`; `answer` is what was recognised, or why it was refused."""
    about = {
        "unit": unit_id(chunk.sha256, cloud.message, cloud.cluster),
        "input_sha256": chunk.sha256,
        "message": cloud.message,
        "cluster": cloud.cluster,
        "topic": cloud.topic or None,
        "frame_id": cloud.frame_id or None,
        "stamp": cloud.stamp_ns,
        "contact_id": cloud.contact_id or None,
        "points": len(cloud.points_level),
        "sensor_height": sensor_height,
    }
    return about | ({"error": answer} if isinstance(answer, str) else _answered(answer))


def cloud_of(unit: str, restored: RestoredCloud) -> dict[str, Any]:
    """A row of the restored clouds."""
    x, y, z = restored.points_level.T
    return {"unit": unit, "x": x, "y": y, "z": z, "measured": restored.measured}


def _answered(recognition: Recognition | Answer) -> dict[str, Any]:
    box = recognition.box
    x, y, z = box.center_level
    return {
        "vessel": recognition.vessel,
        "probability": recognition.probability,
        "unknown": recognition.unknown,
        "probabilities": list(recognition.probabilities.items()),
        "reasons": list(recognition.reasons),
        "heading": recognition.heading,
        "heading_std": recognition.heading_std,
        "bow_probability": recognition.bow_probability,
        "aspect_deg": recognition.aspect_deg,
        "true_heading_deg": recognition.true_heading_deg,
        "box_x": x,
        "box_y": y,
        "box_z": z,
        "length": box.size.length,
        "beam": box.size.beam,
        "height": box.size.height,
        "measured_points": recognition.measured_points,
        "inferred_points": recognition.inferred_points,
        "preset": recognition.preset,
        "image_method": recognition.image_method,
        "stage_ms": list(recognition.stage_ms.items()),
    }
