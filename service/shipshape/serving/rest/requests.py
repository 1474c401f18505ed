"""A request's headers and bytes -> contacts and wishes."""

from collections.abc import Mapping
from typing import Any, TypeVar

from fastapi import HTTPException, Request
from pydantic import BaseModel, ValidationError
from pydantic_core import from_json

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import (
    Limits,
    Wishes,
    check_contacts,
    make_contact,
    make_wishes,
    points_from_base64,
    points_from_bytes,
    points_from_rows,
)
from shipshape.serving.rest.schemas import (
    CapacityFields,
    ContactBody,
    ContactFields,
    OptionsFields,
    QueryFields,
    RecogniseBody,
    ScanBody,
)
from shipshape.serving.timing import LONGEST_MS
from shipshape.types import Contact, Options

JSON = "application/json"
PACKED = "application/octet-stream"
TIMEOUT_HEADER = "Shipshape-Timeout-Ms"
M = TypeVar("M", bound=BaseModel)


def media_type(request: Request, *accepted: str) -> str:
    """The body's media type, one of `accepted`; anything else is 415."""
    given = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if given not in accepted:
        raise HTTPException(415, f"expected a body of type {' or '.join(accepted)}, got {given or 'none'}")
    return given


def timeout_s(request: Request, default_ms: float) -> float:
    """Seconds that the caller gives this request.

    Raises:
        InvalidInput: The header is no number of milliseconds above 0.
    """
    text = request.headers.get(TIMEOUT_HEADER)
    try:
        milliseconds = default_ms if text is None else float(text)
    except ValueError:
        milliseconds = -1.0
    if not 0 < milliseconds <= LONGEST_MS:
        raise InvalidInput(f"expected {TIMEOUT_HEADER} above 0 and up to {LONGEST_MS:.0f}, got {text!r:.40}")
    return milliseconds / 1e3


def parse_packed(body: bytes, query: Mapping[str, str], limits: Limits) -> tuple[Contact, Wishes]:
    """One contact of packed points, everything else in the query."""
    fields = _validated(QueryFields, dict(query))
    return _contact(fields, points_from_bytes(body, limits)), _wishes(fields)


def parse_capacity(query: Mapping[str, str]) -> CapacityFields:
    """What somebody wants to know the capacity for."""
    return _validated(CapacityFields, dict(query))


def parse_json(body: bytes, query: Mapping[str, str], limits: Limits) -> tuple[Contact, Wishes]:
    """One contact in JSON; a query would be overlooked, so there must be none."""
    fields = _validated(RecogniseBody, _json(body, query))
    return _with_points(fields, limits), _wishes(fields)


def parse_scan(body: bytes, query: Mapping[str, str]) -> ScanBody:
    """A scan in JSON, its contacts still as they came."""
    return _validated(ScanBody, _json(body, query))


def decode_scan(scan: ScanBody, limits: Limits) -> tuple[list[str], list[Contact | InvalidInput], Wishes]:
    """The contacts of a scan with their ids, an error in the place of each that cannot be decoded."""
    check_contacts(len(scan.contacts), limits)
    contacts: list[Contact | InvalidInput] = []
    for raw in scan.contacts:
        try:
            contacts.append(_with_points(_validated(ContactBody, raw), limits))
        except InvalidInput as error:
            contacts.append(error)
    return [_id_of(raw) for raw in scan.contacts], contacts, _wishes(scan)


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


def _json(body: bytes, query: Mapping[str, str]) -> Any:
    if query:
        raise InvalidInput(f"expected no query beside a JSON body, got {next(iter(query))!r:.80}")
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


def _contact(fields: ContactFields, points_level: Any) -> Contact:
    return make_contact(
        points_level,
        contact_id=fields.contact_id,
        sensor_height_m=fields.sensor_height_m,
        own_true_heading_deg=fields.own_true_heading_deg,
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
