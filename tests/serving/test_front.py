"""The busy paths answer what the framework would, to the byte; and what queries are remembered."""

import json

import pytest

from contract.test_forms import said
from serving.fakes import cluster, rows, running
from shipshape.errors import InvalidInput
from shipshape.executor import Lane
from shipshape.serving.encoding import Limits
from shipshape.serving.rest import app, requests
from shipshape.serving.rest.front import Front
from shipshape.serving.rest.requests import CONTACT_FORMS, JSON, NPY, PACKED, SCAN_FORMS, parse_packed

POINTS = cluster()
BODY = POINTS.tobytes()
TEXT = json.dumps({"points": rows(POINTS)}).encode()
ASKED = {
    "packed": ("/v1/recognise?contact_id=a%20b&lane=batch&include_restored=true", BODY, PACKED),
    "json": ("/v1/recognise", TEXT, JSON),
    "scan": ("/v1/scan?counts=20,20", BODY, PACKED),
    "scan in json": ("/v1/scan", json.dumps({"contacts": [{"points": rows(POINTS)}, {}]}).encode(), JSON),
    "path with escapes": ("/v1/%72ecognise", BODY, PACKED),
    "last of two": ("/v1/recognise?lane=batch&lane=tracking", BODY, PACKED),
    "empty value": ("/v1/recognise?contact_id=", BODY, PACKED),
    "unknown field": ("/v1/recognise?colour=red", BODY, PACKED),
    "no such lane": ("/v1/recognise?lane=fast", BODY, PACKED),
    "query beside json": ("/v1/recognise?lane=batch", TEXT, JSON),
    "no counts": ("/v1/scan", BODY, PACKED),
    "broken body": ("/v1/recognise", BODY[:-1], PACKED),
    "few points": ("/v1/recognise", BODY[:36], PACKED),
    "media type": ("/v1/recognise", BODY, "text/csv"),
    "another bundle": ("/v1/recognise?bundle=other", BODY, PACKED),
}


@pytest.fixture(scope="module")
def framework():
    """A service whose every path goes through the framework."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(app, "Front", lambda inner, posts: Front(inner, {}))
        with running() as doors:
            yield doors


def answer(doors, path, body, kind):
    """Status, headers without what passes, and body without milliseconds."""
    response = doors.rest.post(path, content=body, headers={"content-type": kind, "X-Request-Id": "one"})
    headers = [(name, value) for name, value in response.headers.raw if name.lower() not in PASSING]
    return said(response), headers


PASSING = (b"date", b"server-timing", b"content-length")


@pytest.mark.parametrize("name", ASKED)
def test_both_ways_give_the_same_answer(doors, framework, name):
    assert answer(doors, *ASKED[name]) == answer(framework, *ASKED[name])


@pytest.mark.parametrize("method", ["GET", "PUT", "DELETE", "OPTIONS", "HEAD"])
def test_other_methods_are_the_frameworks(doors, framework, method):
    answers = [
        each.rest.request(method, "/v1/scan", headers={"X-Request-Id": "one"}) for each in (doors, framework)
    ]
    assert answers[0].status_code == answers[1].status_code == 405
    assert answers[0].content == answers[1].content


def test_a_query_is_validated_once_however_often_it_comes(monkeypatch):
    requests._read_query.cache_clear()
    seen = []
    validated = requests._validated
    monkeypatch.setattr(requests, "_validated", lambda model, value: seen.append(value) or validated(model, value))
    for _ in range(3):
        contact, wishes = parse_packed(BODY, "contact_id=c7&lane=batch", Limits())
        assert (contact.contact_id, wishes.lane) == ("c7", Lane.BATCH)
    assert len(seen) == 1


def test_what_is_remembered_is_bounded():
    requests._read_query.cache_clear()
    for number in range(2 * requests.REMEMBERED):
        parse_packed(BODY, f"contact_id={number}", Limits())
    assert requests._read_query.cache_info().currsize == requests.REMEMBERED
    long = "contact_id=" + "%20" * (requests.LONGEST_REMEMBERED // 3)
    before = requests._read_query.cache_info()
    with pytest.raises(InvalidInput):
        parse_packed(BODY, long, Limits())
    parse_packed(BODY, "contact_id=" + "%20" * 3 + "&contact_id=x" * (requests.LONGEST_REMEMBERED // 10), Limits())
    assert requests._read_query.cache_info() == before


def test_a_wrong_query_is_wrong_each_time():
    for _ in range(2):
        with pytest.raises(InvalidInput, match="colour"):
            parse_packed(BODY, "colour=red", Limits())


def test_the_lane_of_a_form_is_what_its_query_tells():
    assert CONTACT_FORMS[NPY].lane("lane=batch") is Lane.BATCH
    assert CONTACT_FORMS[PACKED].lane("") is Lane.TRACKING
    assert SCAN_FORMS[PACKED].lane("lane=collision&counts=1") is Lane.COLLISION
    assert CONTACT_FORMS[JSON].lane("") is Lane.COLLISION, "it stands in the body"
