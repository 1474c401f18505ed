"""Clients of other makers, as they are published, get our answers: Triton's and KServe's, over HTTP and gRPC.

Each runs in a process of its own: their generated messages have the names of ours, and a pool holds a name once.
"""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from oip.wire import read
from serving.fakes import PATIENCE
from shipshape.v1 import shipshape_pb2 as pb

ROOT = Path(__file__).parents[2]
PYTHON = Path(sys.prefix) / "clients/bin/python"
CLIENTS = Path(__file__).parent / "clients"
SCAN = ROOT / "examples/contacts.npz"
FEW = "expected at least 10 points in a cluster, got 3"
DOUBLE = "expected input points of datatype FP32, got 'FP64'"
OTHER = "expected model shipshape, got 'other'"
needs_clients = pytest.mark.skipif(not PYTHON.is_file(), reason="`make clients` has not run")
STATUS = {
    "rest": {FEW: "422", DOUBLE: "400", OTHER: "404"},
    "grpc": {
        FEW: "StatusCode.INVALID_ARGUMENT",
        DOUBLE: "StatusCode.INVALID_ARGUMENT",
        OTHER: "StatusCode.NOT_FOUND",
    },
}
REFUSALS = {"triton.py": [FEW, DOUBLE, OTHER], "kserve_client.py": [FEW]}


def run(*command):
    ran = subprocess.run([PYTHON, *command], check=False, cwd=ROOT, capture_output=True, text=True, timeout=240)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.splitlines()


def expected(real):
    """The answers of shipshape.v1 to the contacts of the scan."""
    saved = np.load(SCAN, allow_pickle=False)
    contacts = [
        pb.Contact(contact_id=str(len(points)), points=points.astype("<f4").tobytes())
        for points in np.split(saved["points"], np.cumsum(saved["n"])[:-1])
    ]
    scan = real.stub.RecogniseScan(pb.RecogniseScanRequest(contacts=contacts), timeout=PATIENCE)
    found = [result.recognition for result in scan.results]
    boxes = [each.box for each in found]
    return {
        "contact_id": [each.contact_id for each in found],
        "vessel": [each.vessel for each in found],
        "probability": [each.probability for each in found],
        "heading": [each.heading for each in found],
        "box": [[b.center.x, b.center.y, b.center.z, b.length, b.beam, b.height] for b in boxes],
    }


@needs_clients
@pytest.mark.parametrize("script", REFUSALS)
def test_stock_clients(real, script):
    addresses = [f"127.0.0.1:{port}" for port in (real.addresses.rest_port, real.addresses.grpc_port)]
    reports = json.loads(run(CLIENTS / script, *addresses, SCAN)[-1])
    right = expected(real)
    assert len(set(right["heading"])) == len(right["heading"])
    for door, report in reports.items():
        states = [report[name] for name in ("live", "ready", "model_ready", "other_ready")]
        assert states == [True, True, True, False]
        assert report["answers"]
        assert all(answer == right for answer in report["answers"])
        for (status, words), refusal in zip(report["refusals"], REFUSALS[script], strict=True):
            assert refusal in words
            assert status == STATUS[door][refusal]
        if script == "triton.py":
            assert_metadata_and_defaults(report, right)


def assert_metadata_and_defaults(report, right):
    """What Triton's clients get when they ask for nothing in particular."""
    assert report["server"] == "shipshape"
    assert report["inputs"] == ["points", "counts", "sensor_height_m", "own_true_heading_deg", "contact_id"]
    assert report["alone"]["vessel"] == right["vessel"][:1]
    assert max(report["alone"]["probabilities"][0]) >= right["probability"][0]
    assert sum(report["alone"]["probabilities"][0]) == pytest.approx(1)
    assert (report["alone"]["unknown"], report["alone"]["error"]) == ([False], [""])


EXAMPLES = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/oip.md").read_text(encoding="utf-8"), re.M | re.S)


@needs_clients
@pytest.mark.parametrize("maker", ["tritonclient", "kserve"])
def test_the_examples_of_the_documentation(real, maker):
    """Those of one maker in one process, one after the other: over HTTP, then over gRPC."""
    examples = "\n".join(example for example in EXAMPLES if f" {maker}" in example)
    for stated, actual in ((8080, real.addresses.rest_port), (50051, real.addresses.grpc_port)):
        assert examples.count(f"127.0.0.1:{stated}") == 1
        examples = examples.replace(f"127.0.0.1:{stated}", f"127.0.0.1:{actual}")
    right = expected(real)
    lines = [f"{vessel} {p}" for vessel, p in zip(right["vessel"], right["probability"], strict=True)]
    assert run("-c", examples) == lines * 2


def test_the_example_for_curl(real):
    """As a shell would run it; only the address differs."""
    text = (ROOT / "docs/oip.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"^curl .*?'$\n", text, re.M | re.S)
    words = shlex.split(command)
    reply = read(real.rest.post(words[2].partition("8080")[2], content=words[4]))
    assert list(reply.outputs) == ["vessel", "box"]
