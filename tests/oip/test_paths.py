"""Paths, verbs and media types that are not the protocol's get its error object."""

import pytest

from oip.wire import INFER


@pytest.mark.parametrize(
    ("verb", "path", "status", "error"),
    [
        ("GET", "/v2/nowhere", 404, "expected a path of the Open Inference Protocol, got '/v2/nowhere'"),
        ("GET", INFER, 405, f"expected POST on {INFER}, got GET"),
        ("DELETE", "/v2", 405, "expected GET on /v2, got DELETE"),
    ],
)
def test_paths_and_verbs_that_are_not_the_protocols(doors, verb, path, status, error):
    response = doors.rest.request(verb, path)
    assert (response.status_code, response.json()["error"]) == (status, error)
    assert ("allow" in response.headers) == (status == 405)


@pytest.mark.parametrize("header", [{"content-type": "text/csv"}, {"content-encoding": "gzip"}])
def test_other_bodies_are_refused(doors, header):
    response = doors.rest.post(INFER, content=b"x", headers=header)
    assert response.status_code == 415
    assert response.json()["error"].startswith("expected a body ")
