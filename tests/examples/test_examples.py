"""Every example says of the same contact what the pipeline says, and one clear sentence where no service is."""

import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from client.scripted import gone
from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.pointfiles import read_clusters
from shipshape.types import Contact

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
CLIENTS = Path(sys.prefix) / "clients/bin/python"
needs_curl = pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
needs_clients = pytest.mark.skipif(not CLIENTS.is_file(), reason="`make clients` has not run")
needs_node = pytest.mark.skipif(shutil.which("npm") is None, reason="node and npm are not installed")
NPM_PATIENCE = 120.0


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


@pytest.fixture(scope="module")
def expected():
    """The line that the examples print, without a service."""
    (points,) = read_clusters(EXAMPLES / "contact.pcd")
    found = Pipeline(load_bundle(ROOT / "models")).run(Contact(points, sensor_height=3.0))
    assert found.vessel == "pilot_boat"
    return f"{found.vessel} {found.probability:.4f} {math.degrees(found.heading):.2f}"


def printed(ran):
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.splitlines()


def test_the_client(real, expected):
    port = real.addresses.grpc_port
    lines = printed(run(sys.executable, EXAMPLES / "client.py", gone(), f"grpc://127.0.0.1:{port}"))
    assert lines[0] == expected
    assert lines[1].startswith("  829 points measured, ")
    assert lines[2:8] == [
        f"  contact {number}: {vessel}"
        for number, vessel in enumerate(["rhib", "pilot_boat", "fishing_boat", "tug", "patrol_boat", "unknown"], 1)
    ]
    assert sorted(lines[8:]) == [f"  scan {number}: 2 contacts, in time" for number in range(3)]


def test_grpc_stubs(real, expected):
    ran = run(sys.executable, EXAMPLES / "grpc_stub.py", f"127.0.0.1:{real.addresses.grpc_port}")
    assert printed(ran) == [expected]


def test_rest(real, expected):
    assert printed(run(sys.executable, EXAMPLES / "rest.py", f"http://127.0.0.1:{real.addresses.rest_port}")) == [
        expected
    ]


@needs_curl
def test_curl(real, expected):
    found = json.loads(run(EXAMPLES / "curl.sh", f"http://127.0.0.1:{real.addresses.rest_port}").stdout)
    assert f"{found['vessel']} {found['probability']:.4f} {math.degrees(found['heading']):.2f}" == expected


@needs_clients
def test_triton(real, expected):
    assert printed(run(CLIENTS, EXAMPLES / "triton.py", f"127.0.0.1:{real.addresses.grpc_port}")) == [expected]


@pytest.fixture(scope="module")
def node(tmp_path_factory):
    """A copy of what the Node example needs, with its packages installed."""
    folder = tmp_path_factory.mktemp("node")
    shutil.copytree(EXAMPLES / "node", folder / "examples/node", ignore=shutil.ignore_patterns("node_modules"))
    shutil.copy(EXAMPLES / "contact.pcd", folder / "examples")
    shutil.copytree(ROOT / "proto", folder / "proto")
    command = ["npm", "--prefix", folder / "examples/node", "ci", "--no-audit", "--no-fund", "--ignore-scripts"]
    try:
        installed = subprocess.run(command, capture_output=True, text=True, check=False, timeout=NPM_PATIENCE)
    except subprocess.TimeoutExpired:
        pytest.skip("npm reaches no registry")
    if installed.returncode:
        pytest.skip(f"npm could not install the packages: {installed.stderr.strip()[-200:]}")
    return folder / "examples/node/client.js"


@needs_node
def test_node(real, expected, node):
    assert printed(run("node", node, f"127.0.0.1:{real.addresses.grpc_port}")) == [expected]


@needs_node
def test_node_without_a_service(node):
    ran = run("node", node, gone().removeprefix("grpc://"))
    assert ran.returncode == 1
    assert ran.stderr.startswith("client.js: UNAVAILABLE: ")


@pytest.mark.parametrize(
    ("script", "address", "sentence"),
    [
        ("client.py", "{}", "client: expected a service at "),
        ("grpc_stub.py", "{}", "grpc_stub: UNAVAILABLE: "),
        ("rest.py", "http://{}", "rest: expected a service at "),
    ],
)
def test_without_a_service_one_sentence_says_so(script, address, sentence):
    nobody = gone() if script == "client.py" else gone().removeprefix("grpc://")
    ran = run(sys.executable, EXAMPLES / script, address.format(nobody))
    assert ran.returncode == 1
    assert ran.stderr.startswith(sentence)
    assert "Traceback" not in ran.stderr
