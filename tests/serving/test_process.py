"""The real thing: a process with the shipped bundle, from start to SIGTERM."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import grpc
import httpx
import pytest

from serving.fakes import PATIENCE, cluster, request, rows
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

TESTS = Path(__file__).parents[1]
MODELS = TESTS.parent / "models"
SERVE = """
import sys
from shipshape.serving import life
from shipshape.settings import load_settings
{before}
sys.exit(life.serve(load_settings()))
"""
WITH_FAKES = """
from serving.fakes import PNG, FakeBundle, FakePipeline
life.load_bundle = lambda path: FakeBundle()
life.Pipeline = lambda bundle, limits: FakePipeline()
life.render_png = lambda contact, recognition: PNG
"""
START_PATIENCE = 60.0
needs_models = pytest.mark.skipif(
    not (MODELS / "manifest.toml").is_file(), reason="models/ has no manifest.toml yet"
)


def start(before="", **variables):
    environment = {name: value for name, value in os.environ.items() if not name.startswith("SHIPSHAPE_")}
    environment |= {"SHIPSHAPE_REST_PORT": "0", "SHIPSHAPE_GRPC_PORT": "0", "PYTHONPATH": str(TESTS), **variables}
    script = [sys.executable, "-c", SERVE.format(before=before)]
    return subprocess.Popen(script, env=environment, stderr=subprocess.PIPE, text=True)


def until_ready(process):
    """The ports of the line that says so."""
    for line in process.stderr:
        message = json.loads(line)["message"]
        if match := re.match(r"ready: REST http://127.0.0.1:(\d+), gRPC 127.0.0.1:(\d+)", message):
            return int(match[1]), int(match[2])
    pytest.fail(f"it ended with {process.wait(PATIENCE)} before it was ready")


@pytest.mark.parametrize(
    ("before", "number"),
    [(WITH_FAKES, signal.SIGTERM), pytest.param("", signal.SIGINT, marks=needs_models)],
    ids=["fakes", "models"],
)
def test_a_process_serves_and_stops_when_told_to(before, number):
    with start(before, SHIPSHAPE_BUNDLE=str(MODELS)) as process:
        try:
            rest_port, grpc_port = until_ready(process)
            points = cluster(400)
            with grpc.insecure_channel(f"127.0.0.1:{grpc_port}") as channel:
                by_grpc = ShipshapeStub(channel).Recognise(request(points), timeout=PATIENCE).recognition
            url = f"http://127.0.0.1:{rest_port}/v1/recognise"
            by_rest = httpx.post(url, json={"points": rows(points)}, timeout=PATIENCE, trust_env=False).json()
            assert by_grpc.vessel == by_rest["vessel"]
            assert by_grpc.heading == pytest.approx(by_rest["heading"])
            process.send_signal(number)
            assert process.wait(START_PATIENCE) == 0
            assert json.loads(process.stderr.read().splitlines()[-1])["message"] == "stopped"
        finally:
            process.kill()
