"""The commands of docs/operations.md, in their order, with a real service."""

import os
import re
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from serving.bundles import write_wider_bundle
from serving.fakes import PATIENCE
from serving.processes import MODELS, START_PATIENCE, TESTS

PAGE = TESTS.parent / "docs/operations.md"
pytestmark = [
    pytest.mark.skipif(not (MODELS / "manifest.toml").is_file(), reason="models/ has no manifest.toml yet"),
    pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed"),
]


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return str(listener.getsockname()[1])


def wait_for(url):
    for _ in range(int(START_PATIENCE * 10)):
        try:
            if httpx.get(url, timeout=PATIENCE, trust_env=False).status_code == 200:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.1)
    pytest.fail("it was never ready")


def test_the_commands_work(tmp_path):
    ports = {"9090": free_port(), "9091": free_port()}
    start, *calls = re.findall(r"^```sh\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    start, *calls = (re.sub("909[01]", lambda match: ports[match[0]], block) for block in (start, *calls))
    start = start.replace("shipshape serve", "exec shipshape serve")
    shutil.copytree(MODELS, tmp_path / "models")
    write_wider_bundle(tmp_path / "models-2")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("SHIPSHAPE_")}
    environment |= {"SHIPSHAPE_REST_PORT": "0", "SHIPSHAPE_GRPC_PORT": "0"}
    environment["PATH"] = f"{Path(sys.executable).parent}:{environment['PATH']}"
    shell = {"cwd": tmp_path, "env": environment}
    with subprocess.Popen(["sh", "-ec", start], stderr=subprocess.DEVNULL, **shell) as service:
        try:
            wait_for(f"http://127.0.0.1:{ports['9091']}/readyz")
            shown = [
                subprocess.run(["sh", "-ec", call], check=True, capture_output=True, **shell) for call in calls
            ]
            assert b'"status":"ready"' in shown[0].stdout
            assert shown[1].stdout.startswith(b'{"state":"ready"')
            assert b'"bundle":{"name":"wider"' in shown[1].stdout
            assert shown[1].stdout.rstrip().endswith(b"}")
            service.terminate()
            assert service.wait(START_PATIENCE) == 0
        finally:
            service.kill()
