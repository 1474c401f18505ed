"""What OpenAPI says beyond what the framework can see: bodies are read and checked by our own code."""

from collections.abc import Sequence
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from shipshape.serving.faults import FaultKind
from shipshape.serving.rest.headers import TIMEOUT_HEADER
from shipshape.serving.rest.problems import MEDIA_TYPE, STATUS
from shipshape.serving.rest.requests import JSON, NPY, PACKED, POINTCLOUD2
from shipshape.serving.rest.schemas import (
    CapacityFields,
    ContactBody,
    PointCloud2Fields,
    Problem,
    QueryFields,
    RecogniseBody,
    ScanBody,
    ScanQueryFields,
)

REF = "#/components/schemas/{model}"
REQUESTS: Sequence[type[BaseModel]] = (ContactBody, RecogniseBody, ScanBody, Problem)
_PROBLEM = {MEDIA_TYPE: {"schema": {"$ref": REF.format(model="Problem")}}}
_SCHEMES = {"token": {"type": "http", "scheme": "bearer", "description": "Where the service asks for tokens."}}
_BINARY = {"schema": {"type": "string", "format": "binary"}}
_TIMEOUT = {
    "name": TIMEOUT_HEADER,
    "in": "header",
    "description": "Milliseconds that the answer may take; a late one is not computed. "
    "Absent: default_timeout_ms of /v1/model.",
    "schema": {"type": "number", "exclusiveMinimum": 0},
}


def recognise_extra() -> dict[str, Any]:
    """Body and parameters of /v1/recognise."""
    body = {JSON: _json("RecogniseBody"), PACKED: _BINARY, NPY: _BINARY, POINTCLOUD2: _BINARY}
    return {"requestBody": _body(body), "parameters": [_TIMEOUT, *_query(PointCloud2Fields)]}


def scan_extra() -> dict[str, Any]:
    """Body and parameters of /v1/scan."""
    body = {JSON: _json("ScanBody"), PACKED: _BINARY}
    return {"requestBody": _body(body), "parameters": [_TIMEOUT, *_query(ScanQueryFields)]}


def capacity_extra() -> dict[str, Any]:
    """Parameters of /v1/capacity, and the refusal of wrong ones."""
    refusals = problems(FaultKind.INVALID_INPUT)
    return {"parameters": _in_query(CapacityFields), "responses": {str(code): refusals[code] for code in refusals}}


def problems(*kinds: FaultKind) -> dict[int | str, dict[str, Any]]:
    """The refusals of a path."""
    return {
        STATUS[kind]: {"description": kind.replace("_", " ").capitalize() + ".", "content": _PROBLEM}
        for kind in kinds
    }


def unsupported() -> dict[int | str, dict[str, Any]]:
    """The refusal of a body of another media type, which is the framework's and has no kind of its own."""
    return {415: {"description": "Unsupported media type.", "content": _PROBLEM}}


def add_contract(app: FastAPI) -> None:
    """Make /openapi.json hold the schemas of the bodies too."""

    def openapi() -> dict[str, Any]:
        """The contract, made once."""
        if app.openapi_schema is None:
            schema = get_openapi(
                title=app.title, version=app.version, description=app.description, routes=app.routes
            )
            _, definitions = models_json_schema([(model, "validation") for model in REQUESTS], ref_template=REF)
            schema.setdefault("components", {}).setdefault("schemas", {}).update(definitions["$defs"])
            schema["components"]["securitySchemes"] = _SCHEMES
            schema["security"] = [{}, *({name: []} for name in _SCHEMES)]  # with or without
            app.openapi_schema = schema
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]  # the framework's own way to extend the schema


def _body(content: dict[str, Any]) -> dict[str, Any]:
    return {"required": True, "content": content}


def _json(model: str) -> dict[str, Any]:
    return {"schema": {"$ref": REF.format(model=model)}}


def _query(fields: type[BaseModel]) -> list[dict[str, Any]]:
    parameters = _in_query(fields)
    for parameter in parameters:
        parameter["description"] = f"{_beside(parameter['name'])}: {parameter['description']}"
    return parameters


def _in_query(fields: type[BaseModel]) -> list[dict[str, Any]]:
    schema = fields.model_json_schema(ref_template=REF)
    return [
        {
            "name": name,
            "in": "query",
            "description": field.pop("description", name),
            "schema": field,
        }
        for name, field in schema["properties"].items()
    ]


def _beside(name: str) -> str:
    """Which bodies a parameter of the query goes with; beside JSON there is none."""
    if name in PointCloud2Fields.model_fields and name not in QueryFields.model_fields:
        return f"Only beside {POINTCLOUD2}"
    return f"Not beside {JSON}"
