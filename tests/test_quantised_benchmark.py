"""The benchmark of int16 points runs, and its bytes are those of the form."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.skipif(not (ROOT / "models/manifest.toml").is_file(), reason="models/ has no manifest.toml yet")
def test_it_compares_each_form_with_float32(tmp_path):
    command = [sys.executable, ROOT / "benchmarks/quantised.py", "--bundle", ROOT / "models", "--out", tmp_path]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=240)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith("10 clusters of clusters.npz")
    found = json.loads((tmp_path / "quantised.json").read_text(encoding="utf-8"))
    plain, fine, coarse = (found["forms"][name] for name in ("float32", "int16, finest steps", "int16, 1 cm"))
    assert (plain["same_verdict"], plain["heading_deg_max"], plain["moved_mm"]) == (1, 0, 0)
    assert fine["bytes"] == coarse["bytes"] < 0.51 * plain["bytes"]
    assert coarse["gzipped"] < fine["gzipped"] < plain["gzipped"]
    assert fine["moved_mm"] < 1 < coarse["moved_mm"] <= 5.01
    assert coarse["right"] == plain["right"] == 1
