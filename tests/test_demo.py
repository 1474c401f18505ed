import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shipshape.pointfiles import read_clusters

ROOT = Path(__file__).parents[1]
PICTURES = [f"contact-{number}.png" for number in range(1, 7)]


def run_demo(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, ROOT / "examples" / "demo.py"]
    return subprocess.run(command, check=False, cwd=folder, capture_output=True, text=True, timeout=240)


def test_the_sample_scan_is_a_scan_that_classify_reads():
    contacts = read_clusters(ROOT / "examples" / "contacts.npz")
    truth = np.load(ROOT / "examples" / "contacts.npz", allow_pickle=False)
    assert len(contacts) == len(truth["vessel"]) == len(truth["heading"]) == len(PICTURES)
    assert min(len(points) for points in contacts) >= 30


@pytest.mark.skipif(
    not (ROOT / "models" / "manifest.toml").exists(), reason="the default bundle is not trained yet"
)
def test_the_demo_runs_from_start_to_stop(tmp_path):
    demo = run_demo(tmp_path)
    assert demo.returncode == 0, demo.stderr
    assert "gRPC RecogniseScan: 6 contacts" in demo.stdout
    assert "REST POST /v1/recognise: contact 1 is a " in demo.stdout
    assert "service stopped with exit code 0" in demo.stdout
    assert sorted(path.name for path in (tmp_path / "out" / "demo").glob("*.png")) == PICTURES


def test_a_service_that_cannot_start_ends_the_demo_in_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setenv("SHIPSHAPE_BUNDLE", str(tmp_path / "gone"))
    demo = run_demo(tmp_path)
    assert demo.returncode == 1
    assert "demo: the service did not start: " in demo.stderr
    assert "expected a bundle folder at" in demo.stderr
    assert "Traceback" not in demo.stderr
