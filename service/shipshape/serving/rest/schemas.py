"""The JSON of the REST contract. Metres, level frame, radians except where a name ends in _deg."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, WithJsonSchema

from shipshape.budget import Level
from shipshape.executor import Lane
from shipshape.types import ImageMethod, Preset, Reason, Rung

Points = Annotated[
    Any,  # checked by `encoding.points_from_rows`: a validator a number would cost more than the recognition
    WithJsonSchema(
        {
            "type": "array",
            "items": {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
        }
    ),
]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]


class _Asked(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


# A body says of itself what is a number, a string, true or false; in a query everything is text.
_BODY = ConfigDict(strict=True)


class OptionsFields(_Asked):
    """How to compute, and what to put into the answer."""

    # strict=False: a strict enumeration takes no strings, which are all that JSON and a query have.
    preset: Preset = Field(Preset.BEST, strict=False, description="Which set of methods computes the answer.")
    image_method: ImageMethod = Field(
        ImageMethod.FULL_SIDE, strict=False, description="Used by preset paper alone."
    )
    bundle: str = Field("", description="Name or digest of the bundle insisted on; empty: whichever runs.")
    include_restored: bool = Field(False, description="Put the whole vessel's points into the answer.")
    include_images: bool = Field(
        False,
        description="Put the images before and after inpainting, and the SPD2 images of the keypoints, into it.",
    )
    include_png: bool = Field(False, description="Put a picture for people into it.")
    lane: Lane = Field(
        Lane.TRACKING, strict=False, description="What it is for: who goes first when workers are short."
    )
    lowest_rung: Rung = Field(
        Rung.HEADING_AND_BOX,
        strict=False,
        description="The cheapest answer that is better than none; full forbids all others.",
    )
    captured_at: float | None = Field(
        None, description="When the LiDAR saw the contacts, seconds since 1970-01-01 UTC."
    )
    max_age_ms: float | None = Field(
        None, description="Needs captured_at: an answer about what is older is worth nothing, milliseconds."
    )


class CapacityFields(_Asked):
    """What is to be promised."""

    points: int = Field(300, ge=1, description="Points of the contact.")
    lane: Lane = Field(Lane.TRACKING, description="What it is for.")


class SensorFields(_Asked):
    """What the caller knows of its own LiDAR and vessel."""

    sensor_height_m: float | None = Field(
        None, description="LiDAR above the water, metres; absent: the lowest point stands in for the water."
    )
    own_true_heading_deg: float | None = Field(
        None, description="The caller's own heading, degrees clockwise from true north."
    )


class ContactFields(SensorFields):
    """What the caller knows of a contact beside its points."""

    contact_id: str = Field("", description="The caller's name for it, returned; at most 256 characters.")


class ContactBody(ContactFields):
    """One vessel to recognise; its points in one of the two forms."""

    model_config = _BODY

    points: Points = Field(None, description="[x, y, z] each, metres, level frame.")
    points_base64: str | None = Field(
        None, description="The same as packed little-endian float32 x y z, in base64."
    )


class RecogniseBody(ContactBody, OptionsFields):
    """One contact, and how to compute it."""

    model_config = _BODY


class QueryFields(ContactFields, OptionsFields):
    """What goes beside a body of one contact's points."""


Uint32 = Annotated[int, Field(ge=0, lt=2**32)]


class PointCloud2Fields(QueryFields):
    """What goes beside the data of a sensor_msgs/PointCloud2: the other members of that message."""

    fields: str = Field(
        description="name:offset:datatype or name:offset:datatype:count, separated by commas, as in "
        "x:0:7,y:4:7,z:8:7,intensity:16:7. x, y and z are float32 (7) or float64 (8); others are ignored."
    )
    width: Uint32 = Field(description="Points a row.")
    height: Uint32 = Field(1, description="Rows.")
    point_step: Uint32 = Field(description="Bytes from point to point.")
    row_step: Uint32 | None = Field(None, description="Bytes from row to row; absent: width x point_step.")
    is_bigendian: bool = Field(False, description="Byte order of the numbers.")
    is_dense: bool = Field(True, description="False: points that are not finite are dropped, not refused.")


class ScanQueryFields(SensorFields, OptionsFields):
    """What goes beside the packed points of a scan, one contact after the other; holds for all of them."""

    counts: str = Field(description="Points of each contact, separated by commas, as in 40,12,300.")


class ScanBody(OptionsFields):
    """Many contacts of one scan; the options hold for all of them."""

    model_config = _BODY

    contacts: Annotated[
        list[Any],  # each is checked alone, so that a bad one does not spoil the others
        WithJsonSchema({"type": "array", "items": {"$ref": "#/components/schemas/ContactBody"}}),
    ] = Field(description="One or more, up to the limit that /v1/model states.")


class BoxAnswer(BaseModel):
    """Oriented box of the whole vessel; its yaw is the heading."""

    center: Triple = Field(description="Metres, level frame.")
    length: float = Field(description="Along the heading, metres.")
    beam: float = Field(description="Across the heading, metres.")
    height: float = Field(description="Above the waterline, metres.")


class RestoredAnswer(BaseModel):
    """The whole vessel: the measured points as they came (preset paper: one a filled pixel), and the inferred."""

    points: list[Triple] = Field(description="Metres, level frame.")
    measured: list[bool] = Field(description="Of each point: true measured, false inferred.")


class ImagesAnswer(BaseModel):
    """PNG files in base64; black is empty.

    Blue, green, red hold the layers of depth in ascending order: lower, middle, upper in a top view; starboard,
    middle, port in a side view.
    """

    before: str = Field(description="The projected image.")
    after: str = Field(description="The same after inpainting.")


class RecognitionAnswer(BaseModel):
    """What Shipshape says of one contact."""

    contact_id: str = Field(description="As it came in the request.")
    vessel: str = Field(description="The most probable of the catalogue, also when unknown is true.")
    probability: float = Field(description="Of vessel, 0 to 1.")
    probabilities: dict[str, float] = Field(description="Of every vessel and of unknown; they sum to 1.")
    unknown: bool = Field(description="Better treated as a vessel outside the catalogue.")
    reasons: list[Reason] = Field(description="Why to trust this answer less; empty: nothing speaks against it.")
    heading: float = Field(description="Radians counter-clockwise from +x of the level frame, (-pi, pi].")
    heading_std: float = Field(description="Standard deviation of the heading modulo pi, radians.")
    bow_probability: float = Field(description="That the bow points along heading, 0 to 1.")
    aspect_deg: float = Field(description="0 bow-on, 90 abeam, 180 stern-on.")
    true_heading_deg: float | None = Field(
        description="Clockwise from true north, [0, 360); null unless the caller gave its own heading."
    )
    box: BoxAnswer
    measured_points: int = Field(
        description="Points of the restored cloud that were measured: those that the sensor saw; preset paper: "
        "one a filled pixel."
    )
    inferred_points: int = Field(description="Those that were inferred; none below rung full.")
    keypoints: list[Triple] = Field(description="Described for classification; metres, level; none below full.")
    rung: Rung = Field(description="Of the ladder of ever cheaper answers; full is the top.")
    rung_reason: str = Field(description="Why rung is not full: one sentence; empty when it is.")
    preset: Preset
    image_method: ImageMethod | None = Field(description="null: the image of preset best.")
    bundle: str = Field(description="sha256 of the model bundle.")
    stage_ms: dict[str, float] = Field(description="Milliseconds of each stage.")
    restored: RestoredAnswer | None = Field(None, description="Only with include_restored.")
    images: ImagesAnswer | None = Field(None, description="Only with include_images, on rung full.")
    rendered_png: str | None = Field(None, description="Base64; only with include_png.")
    descriptors: list[str] | None = Field(
        None,
        description="SPD2 images of the keypoints, in their order: grey PNG files in base64, 32 columns of "
        "azimuth from astern by starboard. Five times 16 rows of elevation from the zenith down: occupied near, "
        "middle and far; distance of the nearest; depth of what lies there. With include_images, on rung full.",
    )


class ContactError(BaseModel):
    """Why one contact of a scan got no answer."""

    error: str = Field(description="The kind, as in a problem document.")
    detail: str = Field(description="What was expected and what came.")
    retry_after_ms: int | None = Field(None, description="When to come back, of what is overloaded, if known.")


class ContactResult(BaseModel):
    """Outcome for one contact: recognition or error."""

    contact_id: str = Field(description="As it came in the request.")
    recognition: RecognitionAnswer | None = None
    error: ContactError | None = None


class ScanAnswer(BaseModel):
    """Outcomes in the order of the contacts."""

    results: list[ContactResult]


class CatalogueVesselAnswer(BaseModel):
    """A vessel that the bundle knows; metres above the waterline."""

    name: str
    length: float
    beam: float
    height: float


class LimitsAnswer(BaseModel):
    """What this service accepts."""

    max_body_bytes: int = Field(description="Bytes of one request.")
    max_points: int = Field(description="Points of one contact.")
    max_contacts: int = Field(description="Contacts of one scan.")
    default_timeout_ms: float = Field(description="Milliseconds, when the caller sets no deadline.")
    budget_ms: float = Field(description="Milliseconds that an answer is meant to take.")


class ModelAnswer(BaseModel):
    """What this service runs."""

    version: str = Field(description="Of the service.")
    bundle_name: str
    bundle: str = Field(description="sha256 of the bundle.")
    catalogue: list[CatalogueVesselAnswer]
    scores: dict[str, float] = Field(description="What the bundle reached when it was made.")
    stages: list[str] = Field(description="In the order of the data path.")
    limits: LimitsAnswer


class PromiseAnswer(BaseModel):
    """One rung of the ladder."""

    rung: Rung
    milliseconds: float = Field(description="In which a contact would be answered on it now.")


class BudgetAnswer(BaseModel):
    """How the latency budget is doing."""

    level: Level = Field(description="warn: one was over budget a moment ago; error: none was good for a second.")
    budget_ms: float
    good: int = Field(description="Answers inside the budget since the start.")
    bad: int = Field(description="Answers over it, refusals and faults of the service since the start.")
    last_good_s: float | None = Field(description="Since the last good answer; null before the first.")
    burn: dict[str, float] = Field(description="Of the error budget in each window; 1 is as fast as allowed.")


class CapacityAnswer(BaseModel):
    """What the service would promise now."""

    promises: list[PromiseAnswer]
    wait_ms: float = Field(description="Of that, until a worker is free.")
    queue_depth: int = Field(description="Contacts that wait.")
    running: int = Field(description="Contacts that are being computed.")
    workers: int
    budget: BudgetAnswer


class Problem(BaseModel):
    """RFC 9457 problem document."""

    type: str = Field(description="urn:shipshape:problem:<error>.")
    title: str
    status: int
    detail: str = Field(description="One sentence: what was expected and what came.")
    error: str = Field(description="The kind of the error.")
    request_id: str = Field(description="Also in the header X-Request-Id and in the service's log.")
