"""A service in a process of its own: started, waited for, and stopped by a signal."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from serving.fakes import PATIENCE

TESTS = Path(__file__).parents[1]
MODELS = TESTS.parent / "models"
SERVE_FAKES = """
import sys
from serving.fakes import FakePipeline, fake_model
from shipshape.serving import life
from shipshape.settings import load_settings
life.load_model = lambda settings, runtime, folder: fake_model(FakePipeline())
sys.exit(life.serve(load_settings()))
"""
START_PATIENCE = 60.0


def start(*command, **variables):
    environment = {name: value for name, value in os.environ.items() if not name.startswith("SHIPSHAPE_")}
    environment |= {"SHIPSHAPE_REST_PORT": "0", "SHIPSHAPE_GRPC_PORT": "0", "PYTHONPATH": str(TESTS), **variables}
    return subprocess.Popen([sys.executable, *command], env=environment, stderr=subprocess.PIPE, text=True)


def until_ready(process):
    """The ports of the line that says so."""
    for line in process.stderr:
        message = json.loads(line)["message"]
        if match := re.match(r"ready: REST http://127.0.0.1:(\d+), gRPC 127.0.0.1:(\d+)", message):
            return int(match[1]), int(match[2])
    pytest.fail(f"it ended with {process.wait(PATIENCE)} before it was ready")


def stopped_by(process, number):
    process.send_signal(number)
    assert process.wait(START_PATIENCE) == 0
    assert json.loads(process.stderr.read().splitlines()[-1])["message"] == "stopped"
