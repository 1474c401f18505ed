"""The commands of docs/tutorial.md do what the page says."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from shipshape.cli import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")


@pytest.mark.skipif(not (ROOT / "models/manifest.toml").is_file(), reason="models/ has no manifest.toml yet")
def test_a_pcd_file_becomes_the_line_and_the_picture_that_the_page_shows(tmp_path, monkeypatch, capsys):
    shutil.copytree(ROOT / "examples", tmp_path / "examples", ignore=shutil.ignore_patterns("node"))
    monkeypatch.setenv("SHIPSHAPE_BUNDLE", str(ROOT / "models"))
    monkeypatch.chdir(tmp_path)
    (command,) = re.findall(r"^\.venv/bin/shipshape (classify .+)$", PAGE, re.M)
    (shown,) = re.findall(r"^(examples/contact\.pcd .+) \.\.\.$", PAGE, re.M)
    assert main(shlex.split(command)) == 0
    line = capsys.readouterr().out.splitlines()[1]
    assert line.split()[:2] == shown.split()[:2]
    numbers, wanted = (re.findall(r"[+-]?\d+\.\d+", text) for text in (line, shown))
    for got, expected in zip(numbers, wanted, strict=False):  # the last bits differ from processor to processor
        assert float(got) == pytest.approx(float(expected), abs=0.3)
    (picture,) = re.findall(r"draws `(out/\w+\.png)`", PAGE)
    assert Path(picture).read_bytes().startswith(b"\x89PNG")
