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
from serving.fakes import PATIENCE, request
from shipshape.v1 import shipshape_pb2 as pb

ROOT = Path(__file__).parents[2]
PYTHON = Path(sys.prefix) / "clients/bin/python"
CLIENTS = Path(__file__).parent / "clients"
SCAN = ROOT / "examples/contacts.npz"
FEW = "expected at least 10 points in a cluster, got 3"
DOUBLE = "expected input points of datatype FP32, got 'FP64'"
OTHER = "expected model shipshape, got 'other'"
needs_clients = pytest.mark.skipif(not PYTHON.is_file(), reason="`make clients` has not run")
REFUSED = {
    ("triton.py", "http"): [["422", FEW], ["400", DOUBLE], ["404", OTHER]],
    ("triton.py", "grpc"): [
        ["StatusCode.INVALID_ARGUMENT", FEW],
        ["StatusCode.INVALID_ARGUMENT", DOUBLE],
        ["StatusCode.NOT_FOUND", OTHER],
    ],
    ("kserve_client.py", "rest"): [["422", FEW]],
    ("kserve_client.py", "grpc"): [["StatusCode.INVALID_ARGUMENT", FEW]],
}


def run(real, script, kind):
    port = real.addresses.grpc_port if kind == "grpc" else real.addresses.rest_port
    command = [PYTHON, CLIENTS / script, kind, f"127.0.0.1:{port}", SCAN]
    ran = subprocess.run(command, check=False, capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout.splitlines()[-1])


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
@pytest.mark.parametrize(("script", "kind"), REFUSED, ids=lambda name: name.removesuffix(".py"))
def test_a_stock_client(real, script, kind):
    report = run(real, script, kind)
    assert [report[name] for name in ("live", "ready", "model_ready", "other_ready")] == [True, True, True, False]
    right = expected(real)
    assert len(set(right["heading"])) == len(right["heading"])
    assert report["answers"]
    assert all(answer == right for answer in report["answers"])
    for (status, words), refused in zip(report["refusals"], REFUSED[script, kind], strict=True):
        assert status == refused[0]
        assert refused[1] in words


@needs_clients
@pytest.mark.parametrize("kind", ["http", "grpc"])
def test_what_tritons_client_gets_by_default(real, kind):
    report = run(real, "triton.py", kind)
    saved = np.load(SCAN, allow_pickle=False)
    one = real.stub.Recognise(request(saved["points"][: saved["n"][0]]), timeout=PATIENCE).recognition
    assert report["server"] == "shipshape"
    assert report["inputs"] == ["points", "counts", "sensor_height_m", "own_true_heading_deg", "contact_id"]
    assert report["alone"]["vessel"] == [one.vessel]
    assert report["alone"]["probabilities"] == [[each.probability for each in one.probabilities]]
    assert report["alone"]["unknown"] == [one.unknown]
    assert report["alone"]["error"] == [""]


EXAMPLES = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/oip.md").read_text(encoding="utf-8"), re.M | re.S)


@needs_clients
@pytest.mark.parametrize("example", EXAMPLES, ids=["triton-http", "triton-grpc", "kserve-rest", "kserve-grpc"])
def test_the_examples_of_the_documentation(real, example):
    for stated, actual in ((8080, real.addresses.rest_port), (50051, real.addresses.grpc_port)):
        example = example.replace(f"127.0.0.1:{stated}", f"127.0.0.1:{actual}")
    ran = subprocess.run(
        [PYTHON, "-c", example], check=False, cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    assert ran.returncode == 0, ran.stderr
    right = expected(real)
    lines = [f"{vessel} {p}" for vessel, p in zip(right["vessel"], right["probability"], strict=True)]
    assert ran.stdout.splitlines() == lines


def test_the_example_for_curl(real):
    """As a shell would run it; only the address differs."""
    text = (ROOT / "docs/oip.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"^curl .*?'$\n", text, re.M | re.S)
    words = shlex.split(command)
    reply = read(real.rest.post(words[2].partition("8080")[2], content=words[4]))
    assert list(reply.outputs) == ["vessel", "box"]
