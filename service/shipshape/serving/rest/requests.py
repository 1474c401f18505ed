"""A request's body and query -> contacts and wishes, in each of the forms that bodies have."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Generic, TypeVar
from urllib.parse import parse_qsl

from pydantic import BaseModel, ValidationError
from pydantic_core import from_json

from shipshape.errors import InvalidInput
from shipshape.executor import Lane
from shipshape.serving.encoding import (
    Limits,
    Wishes,
    make_contact,
    make_wishes,
    points_from_base64,
    points_from_bytes,
    points_from_rows,
)
from shipshape.serving.encoding_counts import contacts_from_bytes, parse_counts
from shipshape.serving.encoding_npy import points_from_npy
from shipshape.serving.encoding_pointcloud2 import Layout, parse_fields, points_from_pointcloud2
from shipshape.serving.rest.schemas import (
    CapacityFields,
    ContactBody,
    ContactFields,
    OptionsFields,
    PointCloud2Fields,
    QueryFields,
    RecogniseBody,
    ScanBody,
    ScanQueryFields,
    SensorFields,
)
from shipshape.types import Contact, Options

JSON = "application/json"
PACKED = "application/octet-stream"
NPY = "application/x-npy"
POINTCLOUD2 = "application/vnd.shipshape.pointcloud2"
M = TypeVar("M", bound=BaseModel)
Q = TypeVar("Q", bound=OptionsFields)
T = TypeVar("T")
REMEMBERED, LONGEST_REMEMBERED = 256, 1024  # queries, and their length: callers send the same ones again and again


@dataclass(frozen=True, slots=True)
class ParsedScan:
    """A scan as its body brought it."""

    count: int  # of contacts; what follows is decoded only where a scan may have so many
    contact_ids: Sequence[str]
    contacts: Sequence[Contact | InvalidInput]  # an error in the place of each that cannot be decoded
    wishes: Wishes


def parse_packed(body: bytes, query: str, limits: Limits) -> tuple[Contact, Wishes]:
    """One contact of packed points, everything else in the query."""
    fields, wishes = _from_query(QueryFields, query)
    return _contact(fields, points_from_bytes(body, limits)), wishes


def parse_capacity(query: str) -> CapacityFields:
    """What somebody wants to know the capacity for."""
    return _validated(CapacityFields, _pairs(query))


def parse_npy(body: bytes, query: str, limits: Limits) -> tuple[Contact, Wishes]:
    """One contact in a .npy file, everything else in the query."""
    fields, wishes = _from_query(QueryFields, query)
    return _contact(fields, points_from_npy(body, limits)), wishes


def parse_pointcloud2(body: bytes, query: str, limits: Limits) -> tuple[Contact, Wishes]:
    """One contact in the data of a PointCloud2, its layout and everything else in the query."""
    fields, wishes = _from_query(PointCloud2Fields, query)
    return _contact(fields, points_from_pointcloud2(body, _layout(fields), limits)), wishes


def parse_json(body: bytes, query: str, limits: Limits) -> tuple[Contact, Wishes]:
    """One contact in JSON; a query would be overlooked, so there must be none."""
    fields = _validated(RecogniseBody, _json(body, query))
    return _with_points(fields, limits), _wishes(fields)


def parse_packed_scan(body: bytes, query: str, limits: Limits) -> ParsedScan:
    """A scan of packed points; how many each contact has, and everything else, in the query."""
    fields, wishes = _from_query(ScanQueryFields, query)
    counts = parse_counts(fields.counts)
    if len(counts) > limits.max_contacts:
        return ParsedScan(len(counts), [], [], wishes)
    contacts = [
        points if isinstance(points, InvalidInput) else _contact(fields, points)
        for points in contacts_from_bytes(body, counts, limits)
    ]
    return ParsedScan(len(counts), [""] * len(counts), contacts, wishes)


def parse_json_scan(body: bytes, query: str, limits: Limits) -> ParsedScan:
    """A scan in JSON; a query would be overlooked, so there must be none."""
    scan = _validated(ScanBody, _json(body, query))
    count = len(scan.contacts)
    if count > limits.max_contacts:
        return ParsedScan(count, [], [], _wishes(scan))
    contacts: list[Contact | InvalidInput] = []
    for raw in scan.contacts:
        try:
            contacts.append(_with_points(_validated(ContactBody, raw), limits))
        except InvalidInput as error:
            contacts.append(error)
    return ParsedScan(count, [_id_of(raw) for raw in scan.contacts], contacts, _wishes(scan))


def announced_contacts(query: str) -> int:
    """How many contacts the query of a scan of packed points announces."""
    return len(parse_counts(_from_query(ScanQueryFields, query)[0].counts))


@dataclass(frozen=True, slots=True)
class Form(Generic[T]):
    """A form of bodies: how one is parsed, and what its query holds; None: nothing, it is all in the body."""

    parse: Callable[[bytes, str, Limits], T]
    fields: type[OptionsFields] | None

    def lane(self, query: str) -> Lane:
        """What the request is for, as far as its query tells: the most urgent where only the body does."""
        return Lane.COLLISION if self.fields is None else _from_query(self.fields, query)[1].lane


CONTACT_FORMS: Mapping[str, Form[tuple[Contact, Wishes]]] = {
    JSON: Form(parse_json, None),
    PACKED: Form(parse_packed, QueryFields),
    NPY: Form(parse_npy, QueryFields),
    POINTCLOUD2: Form(parse_pointcloud2, PointCloud2Fields),
}
SCAN_FORMS: Mapping[str, Form[ParsedScan]] = {
    JSON: Form(parse_json_scan, None),
    PACKED: Form(parse_packed_scan, ScanQueryFields),
}


def sentence(error: ValidationError) -> str:
    """The first complaint as one sentence that says what was expected and what came."""
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, first["loc"])) or "the body"
    if first["type"] == "missing":
        return f"expected {where}, got none"
    if first["type"] == "extra_forbidden":
        return f"expected only known fields, got {where!r:.80}"
    wanted = first["msg"].removeprefix("Input should be ")
    return f"expected {where} to be {wanted}, got {first['input']!r:.80}"


def _from_query(model: type[Q], query: str) -> tuple[Q, Wishes]:
    """The fields of a query, and the wishes among them."""
    read: Callable[..., Any] = _read_query if len(query) <= LONGEST_REMEMBERED else _read_query.__wrapped__
    fields, wishes = read(model, query)
    return fields, wishes


@lru_cache(REMEMBERED)
def _read_query(model: type[OptionsFields], query: str) -> tuple[OptionsFields, Wishes]:
    fields = _validated(model, _pairs(query))
    return fields, _wishes(fields)


def _pairs(query: str) -> dict[str, str]:
    return dict(parse_qsl(query, keep_blank_values=True))


def _json(body: bytes, query: str) -> Any:
    for name in _pairs(query):
        raise InvalidInput(f"expected no query beside a JSON body, got {name!r:.80}")
    try:
        return from_json(body, allow_inf_nan=True)  # so that NaN is refused as a value, with the right words
    except ValueError as error:
        raise InvalidInput(f"expected JSON, got {len(body)} bytes that are not: {error}") from error


def _validated(model: type[M], value: Any) -> M:
    try:
        return model.model_validate(value)
    except ValidationError as error:
        raise InvalidInput(sentence(error)) from error


def _with_points(fields: ContactBody, limits: Limits) -> Contact:
    given = [name for name in ("points", "points_base64") if getattr(fields, name) is not None]
    if len(given) != 1:
        raise InvalidInput(f"expected one of points and points_base64, got {' and '.join(given) or 'neither'}")
    if fields.points_base64 is not None:
        return _contact(fields, points_from_base64(fields.points_base64, limits))
    return _contact(fields, points_from_rows(fields.points, limits))


def _contact(fields: SensorFields, points_level: Any) -> Contact:
    return make_contact(
        points_level,
        contact_id=fields.contact_id if isinstance(fields, ContactFields) else "",
        sensor_height_m=fields.sensor_height_m,
        own_true_heading_deg=fields.own_true_heading_deg,
    )


def _layout(fields: PointCloud2Fields) -> Layout:
    return Layout(
        parse_fields(fields.fields),
        fields.width,
        fields.height,
        fields.point_step,
        fields.width * fields.point_step if fields.row_step is None else fields.row_step,
        fields.is_bigendian,
        fields.is_dense,
    )


def _wishes(fields: OptionsFields) -> Wishes:
    return make_wishes(
        options=Options(fields.preset, fields.image_method, fields.lowest_rung),
        lane=fields.lane,
        captured_at=fields.captured_at,
        max_age_ms=fields.max_age_ms,
        bundle=fields.bundle,
        restored=fields.include_restored,
        images=fields.include_images,
        png=fields.include_png,
    )


def _id_of(raw: Any) -> str:
    given = raw.get("contact_id", "") if isinstance(raw, dict) else ""
    return given if isinstance(given, str) else ""
