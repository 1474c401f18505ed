"""The examples of docs/api.md run as they stand, against a service, and its table is that of the code."""

import contextlib
import io
import re
from pathlib import Path

from serving.fakes import running
from shipshape.serving.faults import FaultKind
from shipshape.serving.grpc.guard import STATUS as GRPC_STATUS
from shipshape.serving.rest.headers import TIMEOUT_HEADER
from shipshape.serving.rest.problems import STATUS as REST_STATUS
from shipshape.serving.rest.requests import CONTACT_FORMS, SCAN_FORMS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/api.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)


def test_every_example_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    printed, answers, names = io.StringIO(), [], {}
    with running() as doors:
        for example in EXAMPLES:
            here = example.replace(":8080", f":{doors.addresses.rest_port}")
            here = here.replace(":50051", f":{doors.addresses.grpc_port}")
            with contextlib.redirect_stdout(printed):
                exec(compile(here, "docs/api.md", "exec"), names)
            if "rest.post" in example:
                answers.append(names["answer"])
        names["rest"].close()
        names["channel"].close()
    assert [answer.status_code for answer in answers] == [200] * 6, [answer.text for answer in answers]
    assert [answer.json().get("contact_id") for answer in answers[:4]] == ["packed", "npy", "pointcloud2", "json"]
    assert printed.getvalue().count("tug") >= 2 + 6
    assert len(names["answer"].results) == 1


def test_every_form_has_its_example():
    for media_type in {*CONTACT_FORMS, *SCAN_FORMS}:
        assert f"**`{media_type}`**" in PAGE
    assert TIMEOUT_HEADER in PAGE


def test_the_table_of_errors_is_that_of_the_doors():
    for kind in FaultKind:
        assert re.search(rf"^\| {kind} \| {REST_STATUS[kind]}[^|]* \| {GRPC_STATUS[kind].name} \|", PAGE, re.M), (
            kind
        )
