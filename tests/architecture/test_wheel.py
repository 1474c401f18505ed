import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

from architecture.tree import ROOT
from shipshape.console import built

# Imports all of the wheel in an interpreter without the lab's packages, nor those of the load test's extra.
IMPORT_EVERYTHING = """
import importlib, pkgutil, sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        lab = {"torch", "shipshape_lab", "trimesh", "embreex", "matplotlib", "onnx"}
        if name.partition(".")[0] in lab | {"aiohttp", "hdrh", "jinja2", "rich"}:
            raise ModuleNotFoundError(f"the service asked for {name}", name=name)
sys.meta_path.insert(0, Refuse())
import shipshape
assert shipshape.__file__.startswith(sys.argv[1]), shipshape.__file__
for module in pkgutil.walk_packages(shipshape.__path__, "shipshape."):
    if not module.name.endswith("__main__") and not module.name.startswith("shipshape.loadtest"):
        importlib.import_module(module.name)
"""

LOADTEST = """
from shipshape.cli import main
assert main(["loadtest", "grpc://127.0.0.1:1"]) == 2
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def unpacked(wheel):
    folder = wheel.with_suffix("")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def test_the_wheel_holds_the_service_alone(unpacked):
    assert {path.name.partition("-")[0] for path in unpacked.iterdir()} == {"shipshape"}
    kinds = {path.suffix for path in (unpacked / "shipshape").rglob("*") if path.is_file()}
    console = {".css", ".js", ".json", ".svg", ".txt"} if built() else set()
    assert kinds == {".py", ".pyi", ".npy", ".md", ".html", ".typed"} | console


def test_the_wheel_asks_for_nothing_of_the_lab(unpacked):
    (metadata,) = unpacked.glob("*.dist-info/METADATA")
    needed = Parser().parsestr(metadata.read_text(encoding="utf-8")).get_all("Requires-Dist")
    assert "onnxruntime" in needed
    assert not {"torch", "trimesh", "embreex", "onnx", "matplotlib", "shipshape-lab"} & set(needed)


def test_every_module_of_the_wheel_imports_without_the_lab(unpacked):
    _run(["-c", IMPORT_EVERYTHING, str(unpacked)], unpacked)


def test_a_load_test_without_its_extra_says_what_is_missing(unpacked):
    script = IMPORT_EVERYTHING.partition("import shipshape")[0] + LOADTEST
    ran = _run(["-c", script], unpacked)
    assert ran.stderr == (
        "shipshape: expected the libraries of the extra shipshape[loadtest] to be installed, got no aiohttp\n"
    )


def test_the_wheel_brings_its_sample_cluster(unpacked):
    _run(["-c", "from shipshape.sample import sample_contact; sample_contact()"], unpacked)


def _run(arguments: list[str], packages: Path) -> subprocess.CompletedProcess[str]:
    ran = subprocess.run(
        [sys.executable, *arguments],
        env={"PYTHONPATH": str(packages), "PYTHONDONTWRITEBYTECODE": "1", "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    return ran
