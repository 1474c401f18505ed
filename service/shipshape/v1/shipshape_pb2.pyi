from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Preset(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PRESET_UNSPECIFIED: _ClassVar[Preset]
    PRESET_PAPER: _ClassVar[Preset]
    PRESET_BEST: _ClassVar[Preset]

class ImageMethod(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    IMAGE_METHOD_UNSPECIFIED: _ClassVar[ImageMethod]
    IMAGE_METHOD_FULL_TOP: _ClassVar[ImageMethod]
    IMAGE_METHOD_FULL_SIDE: _ClassVar[ImageMethod]
    IMAGE_METHOD_Z_TOP: _ClassVar[ImageMethod]
    IMAGE_METHOD_Z_SIDE: _ClassVar[ImageMethod]

class Lane(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    LANE_UNSPECIFIED: _ClassVar[Lane]
    LANE_COLLISION: _ClassVar[Lane]
    LANE_TRACKING: _ClassVar[Lane]
    LANE_BATCH: _ClassVar[Lane]

class Rung(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    RUNG_UNSPECIFIED: _ClassVar[Rung]
    RUNG_FULL: _ClassVar[Rung]
    RUNG_WITHOUT_RESTORATION: _ClassVar[Rung]
    RUNG_HEADING_AND_BOX: _ClassVar[Rung]

class Reason(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    REASON_UNSPECIFIED: _ClassVar[Reason]
    REASON_FEW_POINTS: _ClassVar[Reason]
    REASON_END_ON: _ClassVar[Reason]
    REASON_OCCLUDED: _ClassVar[Reason]
    REASON_BOW_UNCERTAIN: _ClassVar[Reason]
    REASON_OUT_OF_CATALOGUE: _ClassVar[Reason]

class ErrorKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ERROR_KIND_UNSPECIFIED: _ClassVar[ErrorKind]
    ERROR_KIND_INVALID_INPUT: _ClassVar[ErrorKind]
    ERROR_KIND_TOO_LARGE: _ClassVar[ErrorKind]
    ERROR_KIND_UNPROCESSABLE: _ClassVar[ErrorKind]
    ERROR_KIND_OVERLOADED: _ClassVar[ErrorKind]
    ERROR_KIND_DEADLINE_EXCEEDED: _ClassVar[ErrorKind]
    ERROR_KIND_CANCELLED: _ClassVar[ErrorKind]
    ERROR_KIND_NOT_READY: _ClassVar[ErrorKind]
    ERROR_KIND_INTERNAL: _ClassVar[ErrorKind]
    ERROR_KIND_UNAUTHENTICATED: _ClassVar[ErrorKind]
PRESET_UNSPECIFIED: Preset
PRESET_PAPER: Preset
PRESET_BEST: Preset
IMAGE_METHOD_UNSPECIFIED: ImageMethod
IMAGE_METHOD_FULL_TOP: ImageMethod
IMAGE_METHOD_FULL_SIDE: ImageMethod
IMAGE_METHOD_Z_TOP: ImageMethod
IMAGE_METHOD_Z_SIDE: ImageMethod
LANE_UNSPECIFIED: Lane
LANE_COLLISION: Lane
LANE_TRACKING: Lane
LANE_BATCH: Lane
RUNG_UNSPECIFIED: Rung
RUNG_FULL: Rung
RUNG_WITHOUT_RESTORATION: Rung
RUNG_HEADING_AND_BOX: Rung
REASON_UNSPECIFIED: Reason
REASON_FEW_POINTS: Reason
REASON_END_ON: Reason
REASON_OCCLUDED: Reason
REASON_BOW_UNCERTAIN: Reason
REASON_OUT_OF_CATALOGUE: Reason
ERROR_KIND_UNSPECIFIED: ErrorKind
ERROR_KIND_INVALID_INPUT: ErrorKind
ERROR_KIND_TOO_LARGE: ErrorKind
ERROR_KIND_UNPROCESSABLE: ErrorKind
ERROR_KIND_OVERLOADED: ErrorKind
ERROR_KIND_DEADLINE_EXCEEDED: ErrorKind
ERROR_KIND_CANCELLED: ErrorKind
ERROR_KIND_NOT_READY: ErrorKind
ERROR_KIND_INTERNAL: ErrorKind
ERROR_KIND_UNAUTHENTICATED: ErrorKind

class Contact(_message.Message):
    __slots__ = ("contact_id", "points", "sensor_height_m", "own_true_heading_deg", "points_int16", "origin", "scale")
    CONTACT_ID_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    SENSOR_HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    OWN_TRUE_HEADING_DEG_FIELD_NUMBER: _ClassVar[int]
    POINTS_INT16_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_FIELD_NUMBER: _ClassVar[int]
    SCALE_FIELD_NUMBER: _ClassVar[int]
    contact_id: str
    points: bytes
    sensor_height_m: float
    own_true_heading_deg: float
    points_int16: bytes
    origin: Point
    scale: float
    def __init__(self, contact_id: _Optional[str] = ..., points: _Optional[bytes] = ..., sensor_height_m: _Optional[float] = ..., own_true_heading_deg: _Optional[float] = ..., points_int16: _Optional[bytes] = ..., origin: _Optional[_Union[Point, _Mapping]] = ..., scale: _Optional[float] = ...) -> None: ...

class Options(_message.Message):
    __slots__ = ("preset", "image_method", "bundle", "include_restored", "include_images", "include_png", "lane", "lowest_rung", "captured_at", "max_age_ms")
    PRESET_FIELD_NUMBER: _ClassVar[int]
    IMAGE_METHOD_FIELD_NUMBER: _ClassVar[int]
    BUNDLE_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_RESTORED_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_IMAGES_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_PNG_FIELD_NUMBER: _ClassVar[int]
    LANE_FIELD_NUMBER: _ClassVar[int]
    LOWEST_RUNG_FIELD_NUMBER: _ClassVar[int]
    CAPTURED_AT_FIELD_NUMBER: _ClassVar[int]
    MAX_AGE_MS_FIELD_NUMBER: _ClassVar[int]
    preset: Preset
    image_method: ImageMethod
    bundle: str
    include_restored: bool
    include_images: bool
    include_png: bool
    lane: Lane
    lowest_rung: Rung
    captured_at: float
    max_age_ms: float
    def __init__(self, preset: _Optional[_Union[Preset, str]] = ..., image_method: _Optional[_Union[ImageMethod, str]] = ..., bundle: _Optional[str] = ..., include_restored: _Optional[bool] = ..., include_images: _Optional[bool] = ..., include_png: _Optional[bool] = ..., lane: _Optional[_Union[Lane, str]] = ..., lowest_rung: _Optional[_Union[Rung, str]] = ..., captured_at: _Optional[float] = ..., max_age_ms: _Optional[float] = ...) -> None: ...

class RecogniseRequest(_message.Message):
    __slots__ = ("contact", "options")
    CONTACT_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    contact: Contact
    options: Options
    def __init__(self, contact: _Optional[_Union[Contact, _Mapping]] = ..., options: _Optional[_Union[Options, _Mapping]] = ...) -> None: ...

class RecogniseResponse(_message.Message):
    __slots__ = ("recognition",)
    RECOGNITION_FIELD_NUMBER: _ClassVar[int]
    recognition: Recognition
    def __init__(self, recognition: _Optional[_Union[Recognition, _Mapping]] = ...) -> None: ...

class RecogniseScanRequest(_message.Message):
    __slots__ = ("contacts", "options")
    CONTACTS_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    contacts: _containers.RepeatedCompositeFieldContainer[Contact]
    options: Options
    def __init__(self, contacts: _Optional[_Iterable[_Union[Contact, _Mapping]]] = ..., options: _Optional[_Union[Options, _Mapping]] = ...) -> None: ...

class RecogniseScanResponse(_message.Message):
    __slots__ = ("results",)
    RESULTS_FIELD_NUMBER: _ClassVar[int]
    results: _containers.RepeatedCompositeFieldContainer[ContactResult]
    def __init__(self, results: _Optional[_Iterable[_Union[ContactResult, _Mapping]]] = ...) -> None: ...

class RecogniseStreamRequest(_message.Message):
    __slots__ = ("sequence", "contacts", "options", "timeout_ms")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    CONTACTS_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    TIMEOUT_MS_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    contacts: _containers.RepeatedCompositeFieldContainer[Contact]
    options: Options
    timeout_ms: float
    def __init__(self, sequence: _Optional[int] = ..., contacts: _Optional[_Iterable[_Union[Contact, _Mapping]]] = ..., options: _Optional[_Union[Options, _Mapping]] = ..., timeout_ms: _Optional[float] = ...) -> None: ...

class RecogniseStreamResponse(_message.Message):
    __slots__ = ("sequence", "results", "error", "stages")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    RESULTS_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    STAGES_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    results: _containers.RepeatedCompositeFieldContainer[ContactResult]
    error: ContactError
    stages: _containers.RepeatedCompositeFieldContainer[StageTime]
    def __init__(self, sequence: _Optional[int] = ..., results: _Optional[_Iterable[_Union[ContactResult, _Mapping]]] = ..., error: _Optional[_Union[ContactError, _Mapping]] = ..., stages: _Optional[_Iterable[_Union[StageTime, _Mapping]]] = ...) -> None: ...

class ContactResult(_message.Message):
    __slots__ = ("contact_id", "recognition", "error")
    CONTACT_ID_FIELD_NUMBER: _ClassVar[int]
    RECOGNITION_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    contact_id: str
    recognition: Recognition
    error: ContactError
    def __init__(self, contact_id: _Optional[str] = ..., recognition: _Optional[_Union[Recognition, _Mapping]] = ..., error: _Optional[_Union[ContactError, _Mapping]] = ...) -> None: ...

class ContactError(_message.Message):
    __slots__ = ("kind", "message", "retry_after_ms")
    KIND_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    RETRY_AFTER_MS_FIELD_NUMBER: _ClassVar[int]
    kind: ErrorKind
    message: str
    retry_after_ms: int
    def __init__(self, kind: _Optional[_Union[ErrorKind, str]] = ..., message: _Optional[str] = ..., retry_after_ms: _Optional[int] = ...) -> None: ...

class Recognition(_message.Message):
    __slots__ = ("contact_id", "vessel", "probability", "probabilities", "unknown", "heading", "heading_std", "bow_probability", "aspect_deg", "true_heading_deg", "box", "measured_points", "inferred_points", "keypoints", "rung", "preset", "image_method", "bundle", "stages", "restored", "images", "rendered_png", "reasons", "rung_reason", "descriptors")
    CONTACT_ID_FIELD_NUMBER: _ClassVar[int]
    VESSEL_FIELD_NUMBER: _ClassVar[int]
    PROBABILITY_FIELD_NUMBER: _ClassVar[int]
    PROBABILITIES_FIELD_NUMBER: _ClassVar[int]
    UNKNOWN_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    HEADING_STD_FIELD_NUMBER: _ClassVar[int]
    BOW_PROBABILITY_FIELD_NUMBER: _ClassVar[int]
    ASPECT_DEG_FIELD_NUMBER: _ClassVar[int]
    TRUE_HEADING_DEG_FIELD_NUMBER: _ClassVar[int]
    BOX_FIELD_NUMBER: _ClassVar[int]
    MEASURED_POINTS_FIELD_NUMBER: _ClassVar[int]
    INFERRED_POINTS_FIELD_NUMBER: _ClassVar[int]
    KEYPOINTS_FIELD_NUMBER: _ClassVar[int]
    RUNG_FIELD_NUMBER: _ClassVar[int]
    PRESET_FIELD_NUMBER: _ClassVar[int]
    IMAGE_METHOD_FIELD_NUMBER: _ClassVar[int]
    BUNDLE_FIELD_NUMBER: _ClassVar[int]
    STAGES_FIELD_NUMBER: _ClassVar[int]
    RESTORED_FIELD_NUMBER: _ClassVar[int]
    IMAGES_FIELD_NUMBER: _ClassVar[int]
    RENDERED_PNG_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    RUNG_REASON_FIELD_NUMBER: _ClassVar[int]
    DESCRIPTORS_FIELD_NUMBER: _ClassVar[int]
    contact_id: str
    vessel: str
    probability: float
    probabilities: _containers.RepeatedCompositeFieldContainer[NamedProbability]
    unknown: bool
    heading: float
    heading_std: float
    bow_probability: float
    aspect_deg: float
    true_heading_deg: float
    box: Box
    measured_points: int
    inferred_points: int
    keypoints: _containers.RepeatedCompositeFieldContainer[Point]
    rung: str
    preset: Preset
    image_method: ImageMethod
    bundle: str
    stages: _containers.RepeatedCompositeFieldContainer[StageTime]
    restored: RestoredCloud
    images: ImagePair
    rendered_png: bytes
    reasons: _containers.RepeatedScalarFieldContainer[Reason]
    rung_reason: str
    descriptors: _containers.RepeatedCompositeFieldContainer[Image]
    def __init__(self, contact_id: _Optional[str] = ..., vessel: _Optional[str] = ..., probability: _Optional[float] = ..., probabilities: _Optional[_Iterable[_Union[NamedProbability, _Mapping]]] = ..., unknown: _Optional[bool] = ..., heading: _Optional[float] = ..., heading_std: _Optional[float] = ..., bow_probability: _Optional[float] = ..., aspect_deg: _Optional[float] = ..., true_heading_deg: _Optional[float] = ..., box: _Optional[_Union[Box, _Mapping]] = ..., measured_points: _Optional[int] = ..., inferred_points: _Optional[int] = ..., keypoints: _Optional[_Iterable[_Union[Point, _Mapping]]] = ..., rung: _Optional[str] = ..., preset: _Optional[_Union[Preset, str]] = ..., image_method: _Optional[_Union[ImageMethod, str]] = ..., bundle: _Optional[str] = ..., stages: _Optional[_Iterable[_Union[StageTime, _Mapping]]] = ..., restored: _Optional[_Union[RestoredCloud, _Mapping]] = ..., images: _Optional[_Union[ImagePair, _Mapping]] = ..., rendered_png: _Optional[bytes] = ..., reasons: _Optional[_Iterable[_Union[Reason, str]]] = ..., rung_reason: _Optional[str] = ..., descriptors: _Optional[_Iterable[_Union[Image, _Mapping]]] = ...) -> None: ...

class NamedProbability(_message.Message):
    __slots__ = ("name", "probability")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PROBABILITY_FIELD_NUMBER: _ClassVar[int]
    name: str
    probability: float
    def __init__(self, name: _Optional[str] = ..., probability: _Optional[float] = ...) -> None: ...

class Point(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Box(_message.Message):
    __slots__ = ("center", "length", "beam", "height")
    CENTER_FIELD_NUMBER: _ClassVar[int]
    LENGTH_FIELD_NUMBER: _ClassVar[int]
    BEAM_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    center: Point
    length: float
    beam: float
    height: float
    def __init__(self, center: _Optional[_Union[Point, _Mapping]] = ..., length: _Optional[float] = ..., beam: _Optional[float] = ..., height: _Optional[float] = ...) -> None: ...

class StageTime(_message.Message):
    __slots__ = ("stage", "milliseconds")
    STAGE_FIELD_NUMBER: _ClassVar[int]
    MILLISECONDS_FIELD_NUMBER: _ClassVar[int]
    stage: str
    milliseconds: float
    def __init__(self, stage: _Optional[str] = ..., milliseconds: _Optional[float] = ...) -> None: ...

class RestoredCloud(_message.Message):
    __slots__ = ("points", "measured")
    POINTS_FIELD_NUMBER: _ClassVar[int]
    MEASURED_FIELD_NUMBER: _ClassVar[int]
    points: bytes
    measured: bytes
    def __init__(self, points: _Optional[bytes] = ..., measured: _Optional[bytes] = ...) -> None: ...

class ImagePair(_message.Message):
    __slots__ = ("before", "after")
    BEFORE_FIELD_NUMBER: _ClassVar[int]
    AFTER_FIELD_NUMBER: _ClassVar[int]
    before: Image
    after: Image
    def __init__(self, before: _Optional[_Union[Image, _Mapping]] = ..., after: _Optional[_Union[Image, _Mapping]] = ...) -> None: ...

class Image(_message.Message):
    __slots__ = ("rows", "columns", "channels", "values")
    ROWS_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    CHANNELS_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    rows: int
    columns: int
    channels: int
    values: bytes
    def __init__(self, rows: _Optional[int] = ..., columns: _Optional[int] = ..., channels: _Optional[int] = ..., values: _Optional[bytes] = ...) -> None: ...

class GetModelInfoRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class GetModelInfoResponse(_message.Message):
    __slots__ = ("version", "bundle_name", "bundle", "catalogue", "scores", "stages", "limits")
    class ScoresEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    VERSION_FIELD_NUMBER: _ClassVar[int]
    BUNDLE_NAME_FIELD_NUMBER: _ClassVar[int]
    BUNDLE_FIELD_NUMBER: _ClassVar[int]
    CATALOGUE_FIELD_NUMBER: _ClassVar[int]
    SCORES_FIELD_NUMBER: _ClassVar[int]
    STAGES_FIELD_NUMBER: _ClassVar[int]
    LIMITS_FIELD_NUMBER: _ClassVar[int]
    version: str
    bundle_name: str
    bundle: str
    catalogue: _containers.RepeatedCompositeFieldContainer[CatalogueVessel]
    scores: _containers.ScalarMap[str, float]
    stages: _containers.RepeatedScalarFieldContainer[str]
    limits: Limits
    def __init__(self, version: _Optional[str] = ..., bundle_name: _Optional[str] = ..., bundle: _Optional[str] = ..., catalogue: _Optional[_Iterable[_Union[CatalogueVessel, _Mapping]]] = ..., scores: _Optional[_Mapping[str, float]] = ..., stages: _Optional[_Iterable[str]] = ..., limits: _Optional[_Union[Limits, _Mapping]] = ...) -> None: ...

class CatalogueVessel(_message.Message):
    __slots__ = ("name", "length", "beam", "height")
    NAME_FIELD_NUMBER: _ClassVar[int]
    LENGTH_FIELD_NUMBER: _ClassVar[int]
    BEAM_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    name: str
    length: float
    beam: float
    height: float
    def __init__(self, name: _Optional[str] = ..., length: _Optional[float] = ..., beam: _Optional[float] = ..., height: _Optional[float] = ...) -> None: ...

class Limits(_message.Message):
    __slots__ = ("max_body_bytes", "max_points", "max_contacts", "default_timeout_ms", "budget_ms", "max_streams")
    MAX_BODY_BYTES_FIELD_NUMBER: _ClassVar[int]
    MAX_POINTS_FIELD_NUMBER: _ClassVar[int]
    MAX_CONTACTS_FIELD_NUMBER: _ClassVar[int]
    DEFAULT_TIMEOUT_MS_FIELD_NUMBER: _ClassVar[int]
    BUDGET_MS_FIELD_NUMBER: _ClassVar[int]
    MAX_STREAMS_FIELD_NUMBER: _ClassVar[int]
    max_body_bytes: int
    max_points: int
    max_contacts: int
    default_timeout_ms: float
    budget_ms: float
    max_streams: int
    def __init__(self, max_body_bytes: _Optional[int] = ..., max_points: _Optional[int] = ..., max_contacts: _Optional[int] = ..., default_timeout_ms: _Optional[float] = ..., budget_ms: _Optional[float] = ..., max_streams: _Optional[int] = ...) -> None: ...

class GetCapacityRequest(_message.Message):
    __slots__ = ("points", "lane")
    POINTS_FIELD_NUMBER: _ClassVar[int]
    LANE_FIELD_NUMBER: _ClassVar[int]
    points: int
    lane: Lane
    def __init__(self, points: _Optional[int] = ..., lane: _Optional[_Union[Lane, str]] = ...) -> None: ...

class GetCapacityResponse(_message.Message):
    __slots__ = ("promises", "wait_ms", "queue_depth", "running", "workers", "budget")
    PROMISES_FIELD_NUMBER: _ClassVar[int]
    WAIT_MS_FIELD_NUMBER: _ClassVar[int]
    QUEUE_DEPTH_FIELD_NUMBER: _ClassVar[int]
    RUNNING_FIELD_NUMBER: _ClassVar[int]
    WORKERS_FIELD_NUMBER: _ClassVar[int]
    BUDGET_FIELD_NUMBER: _ClassVar[int]
    promises: _containers.RepeatedCompositeFieldContainer[Promise]
    wait_ms: float
    queue_depth: int
    running: int
    workers: int
    budget: Budget
    def __init__(self, promises: _Optional[_Iterable[_Union[Promise, _Mapping]]] = ..., wait_ms: _Optional[float] = ..., queue_depth: _Optional[int] = ..., running: _Optional[int] = ..., workers: _Optional[int] = ..., budget: _Optional[_Union[Budget, _Mapping]] = ...) -> None: ...

class Promise(_message.Message):
    __slots__ = ("rung", "milliseconds")
    RUNG_FIELD_NUMBER: _ClassVar[int]
    MILLISECONDS_FIELD_NUMBER: _ClassVar[int]
    rung: str
    milliseconds: float
    def __init__(self, rung: _Optional[str] = ..., milliseconds: _Optional[float] = ...) -> None: ...

class Budget(_message.Message):
    __slots__ = ("level", "budget_ms", "good", "bad", "last_good_s", "burn")
    class BurnEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    LEVEL_FIELD_NUMBER: _ClassVar[int]
    BUDGET_MS_FIELD_NUMBER: _ClassVar[int]
    GOOD_FIELD_NUMBER: _ClassVar[int]
    BAD_FIELD_NUMBER: _ClassVar[int]
    LAST_GOOD_S_FIELD_NUMBER: _ClassVar[int]
    BURN_FIELD_NUMBER: _ClassVar[int]
    level: str
    budget_ms: float
    good: int
    bad: int
    last_good_s: float
    burn: _containers.ScalarMap[str, float]
    def __init__(self, level: _Optional[str] = ..., budget_ms: _Optional[float] = ..., good: _Optional[int] = ..., bad: _Optional[int] = ..., last_good_s: _Optional[float] = ..., burn: _Optional[_Mapping[str, float]] = ...) -> None: ...
