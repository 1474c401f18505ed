"""The README's promises about make: the second time asks nothing of the network, a missing tool is told once."""

import os
import shutil
import subprocess

import pytest

from architecture.tree import ROOT

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
LOCKS = ("requirements/service.lock", "requirements/dev.lock", "requirements/clients.lock")
INPUTS = ("Makefile", "pyproject.toml", "lab/pyproject.toml", *LOCKS)
EVERYTHING = ("demo", "serve", "setup", "test", "check")


@pytest.fixture
def copy(tmp_path):
    """What make decides by, in a folder of its own."""
    for file in INPUTS:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    return tmp_path


def installed(folder):
    """The folder after a first `make setup`, as far as make can see: the interpreter, then the stamps."""
    for age, file in ((20, "bin/python"), (10, ".service"), (0, ".dev"), (0, ".clients")):
        path = folder / ".venv" / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        now = path.stat().st_mtime
        os.utime(path, (now + 100 - age, now + 100 - age))


def make(folder, *arguments, **variables):
    alone = {
        name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")
    } | variables
    return subprocess.run(
        ["make", *arguments], check=False, cwd=folder, env=alone, capture_output=True, text=True, timeout=60
    )


def test_the_first_time_installs(copy):
    assert "pip --disable-pip-version-check --quiet install" in make(copy, "-n", *EVERYTHING).stdout


def test_the_second_time_installs_nothing(copy):
    installed(copy)
    planned = make(copy, "-n", *EVERYTHING)
    assert planned.returncode == 0
    assert "examples/demo.py" in planned.stdout
    assert "pytest" in planned.stdout
    assert " install" not in planned.stdout


def test_a_lock_that_changed_installs_again(copy):
    installed(copy)
    path = copy / "requirements/service.lock"
    later = path.stat().st_mtime + 1000
    os.utime(path, (later, later))
    assert "--requirement requirements/service.lock" in make(copy, "-n", "demo").stdout


def test_without_npm_the_console_is_left_out_and_make_goes_on(copy):
    (copy / "console").mkdir()
    shutil.copy(ROOT / "console/build.sh", copy / "console")
    (copy / "bin").mkdir()
    for tool in ("sh", "dirname", "make"):
        (copy / "bin" / tool).symlink_to(shutil.which(tool))
    built = make(copy, "service/shipshape/console/static/index.html", PATH=str(copy / "bin"))
    assert built.returncode == 0
    assert "console: expected Node.js with npm, got none" in built.stderr
    assert built.stdout == "make: / will have no page, everything else works; make console tries again\n"


@pytest.mark.parametrize("target", ["demo", "test"])
def test_a_missing_python_gets_one_clear_sentence(copy, target):
    failed = make(copy, target, "PYTHON=/nowhere/python")
    assert failed.returncode != 0
    told = [line for line in failed.stderr.splitlines() if "***" not in line]  # make's own last word
    expected = "make: expected Python 3.11 as python3.11, python3 or PYTHON=..., found none that starts"
    assert told == [expected]
    assert failed.stdout == ""
    assert not (copy / ".venv/.service").exists()
