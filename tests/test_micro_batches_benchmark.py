"""The benchmark of shared runs: every network and way is measured, and a card that is not there is told."""

import json

import pytest

from benchmarks import micro_batches
from benchmarks.micro_batches import ROOT
from shipshape.micro_batches import BUCKETS
from shipshape.providers import Provider, find_provider


@pytest.mark.skipif(
    not (ROOT / "models/manifest.toml").exists(), reason="there is no trained bundle in models/ yet"
)
def test_every_network_and_every_way_of_sharing_is_measured(tmp_path, capsys):
    out = tmp_path / "numbers.json"
    micro_batches.main(["--provider", "cpu", "--force", "--seconds", "0.01", "--out", str(out)])
    found = json.loads(out.read_text())
    assert set(found["networks"]) == {path.stem for path in (ROOT / "models").glob("*.onnx")}
    for measured in found["networks"].values():
        assert list(measured["rows_per_s"]) == [str(rows) for rows in BUCKETS]
        assert min(measured["rows_per_s"].values()) > 0
        assert measured["chosen"] in BUCKETS
    assert [way for way in found["pipeline"] if way.startswith("up to")] == [
        f"up to {most}" for most in BUCKETS[1:]
    ]
    assert all(told["clusters_per_s"] > 0 for told in found["pipeline"].values())
    printed = capsys.readouterr().out
    assert all(name in printed for name in (*found["networks"], *found["pipeline"]))


@pytest.mark.skipif(find_provider("auto") is Provider.CUDA, reason="there is a GPU")
def test_without_a_card_it_says_so():
    with pytest.raises(SystemExit, match=r"micro_batches: expected CUDA to work, got .*docs/gpu\.md"):
        micro_batches.main(["--provider", "cuda"])
