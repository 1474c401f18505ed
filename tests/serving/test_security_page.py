"""The commands of docs/security.md, run as they stand there, and a service with the files that they made."""

import contextlib
import io
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from serving.fakes import PATIENCE, running
from shipshape.cli import main

PAGE = Path(__file__).parents[2] / "docs/security.md"
BLOCKS = re.findall(r"^```\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
OTHERS = 0o077


def block(word):
    (found,) = [block for block in BLOCKS if word in block]
    return found


def run(folder, *command):
    return subprocess.run(
        command, cwd=folder, check=True, capture_output=True, text=True, timeout=6 * PATIENCE
    ).stdout


def settings_of(folder, script):
    """What `export` of a block sets, as arguments of a service."""
    given = re.findall(r"SHIPSHAPE_(\w+)=(\S+)", script)
    return {name.lower(): folder / file for name, file in given}


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A folder where all was done as the page says, and the service that came of it."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    folder = tmp_path_factory.mktemp("page")
    run(folder, "sh", "-eu", "-c", block("openssl req"))
    made = io.StringIO()
    with contextlib.redirect_stdout(made):  # in this process, which has loaded all that a new one would
        assert main(["token", "fleet"]) == 0
    token = block("shipshape token").replace("$(shipshape token fleet)", f"'{made.getvalue()}'")
    run(folder, "sh", "-eu", "-c", token)
    given = settings_of(folder, block("export SHIPSHAPE_TLS")) | settings_of(folder, token)
    assert set(given) == {"tls_certificate", "tls_key", "tls_client_ca", "tokens_file"}
    with running(**given) as doors:
        yield folder, doors.addresses


def test_no_file_is_open_to_others(page):
    folder, _ = page
    assert [path.name for path in folder.iterdir() if path.stat().st_mode & OTHERS] == []


def test_the_curl_of_the_page(page):
    if shutil.which("curl") is None:
        pytest.skip("curl is not installed")
    folder, addresses = page
    command = block("curl ").replace(":8080", f":{addresses.rest_port}")
    assert '"fake"' in run(folder, "sh", "-eu", "-c", command)
    anonymous = command.replace("Bearer ", "Bearer x").replace("curl ", "curl -o /dev/null -w '%{http_code}' ")
    assert run(folder, "sh", "-eu", "-c", anonymous) == "401"


def test_the_python_of_the_page(page):
    folder, addresses = page
    script = block("grpc.secure_channel").replace(":50051", f":{addresses.grpc_port}")
    assert run(folder, sys.executable, "-c", script) == "fake\n"
