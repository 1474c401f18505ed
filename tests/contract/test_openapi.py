import json
from pathlib import Path

import pytest

from serving.fakes import cluster, rows

SNAPSHOT = Path(__file__).parents[2] / "openapi.json"


def test_the_contract_is_the_committed_one(doors):
    """To accept a change: curl -s localhost:8080/openapi.json | python -m json.tool --indent 1 >openapi.json."""
    served = json.dumps(doors.rest.get("/openapi.json").json(), indent=1) + "\n"
    assert served == SNAPSHOT.read_text(encoding="utf-8")


def test_every_reference_resolves(doors):
    schema = doors.rest.get("/openapi.json").json()
    for reference in _references(schema):
        found = schema
        for part in reference.removeprefix("#/").split("/"):
            found = found[part]


@pytest.mark.parametrize("path", ["/v1/recognise", "/v1/scan", "/v1/model", "/livez", "/readyz", "/metrics"])
def test_paths(doors, path):
    assert path in doors.rest.get("/openapi.json").json()["paths"]


def test_the_bodies_of_the_contract_are_those_that_work(doors):
    schema = doors.rest.get("/openapi.json").json()
    body = schema["components"]["schemas"]["RecogniseBody"]["properties"]
    fields = {name: field["default"] for name, field in body.items() if field.get("default") is not None}
    response = doors.rest.post("/v1/recognise", json={"points": rows(cluster()), **fields})
    assert response.status_code == 200


def test_what_is_no_json_is_not_said_to_be(doors):
    paths = doors.rest.get("/openapi.json").json()["paths"]
    assert list(paths["/metrics"]["get"]["responses"]["200"]["content"]) == ["text/plain"]
    assert doors.rest.get("/metrics").headers["content-type"].startswith("text/plain")
    assert "415" in paths["/v1/recognise"]["post"]["responses"]
    assert "415" in paths["/v1/scan"]["post"]["responses"]


def _references(node):
    if isinstance(node, dict):
        if isinstance(node.get("$ref"), str):
            yield node["$ref"]
        for child in node.values():
            yield from _references(child)
    elif isinstance(node, list):
        for child in node:
            yield from _references(child)
