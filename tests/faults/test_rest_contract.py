"""The REST door against its own contract: whatever schemathesis sends, it answers as openapi.json promises."""

import pytest
import requests
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from schemathesis import GenerationMode
from schemathesis.checks import CHECKS

from faults.live import PATIENCE, POINTS
from serving.processes import TESTS

EXAMPLES = 40
PROMISES = ("status_code_conformance", "content_type_conformance", "response_schema_conformance")
OURS = (500, 501, 502, 503)  # no request may make the service say so; 504 it may, by points that are too old
for form in ("application/octet-stream", "application/x-npy", "application/vnd.shipshape.pointcloud2"):
    schemathesis.openapi.media_type(form, st.binary(max_size=200) | st.just(POINTS.tobytes()))
CONTRACT = schemathesis.openapi.from_path(str(TESTS.parent / "openapi.json"))
OPERATIONS = [operation.ok() for operation in CONTRACT.get_all_operations()]
CASES = [
    *((operation, GenerationMode.POSITIVE) for operation in OPERATIONS),
    *((operation, GenerationMode.NEGATIVE) for operation in OPERATIONS if operation.query or operation.body),
]


@pytest.fixture(scope="module")
def session():
    """A client without proxies."""
    with requests.Session() as session:
        session.trust_env = False
        yield session


@pytest.mark.parametrize(("operation", "mode"), CASES, ids=lambda part: getattr(part, "label", part))
def test_every_answer_is_one_that_the_contract_promises(service, session, operation, mode):
    @settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck))
    @given(operation.as_strategy(generation_mode=mode))
    def ask(case):
        response = case.call(base_url=str(service.rest.base_url), session=session, timeout=PATIENCE)
        assert response.status_code not in OURS, response.text
        case.validate_response(response, checks=CHECKS.get_by_names(PROMISES))

    with service.survives():
        ask()
