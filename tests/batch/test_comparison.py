import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from shipshape.batch import rows
from shipshape.batch.comparison import Flip, compare
from shipshape.cli import main
from shipshape.errors import FileError


def write(folder: Path, *contacts: dict, bundle: str = "b") -> Path:
    """Results of contacts that are told by what differs from a sure tug that heads north-west."""
    usual = {"vessel": "tug", "probability": 0.9, "unknown": False, "heading": 3.1, "points": 50, "message": 0}
    of_all = {"input": "a.npz", "input_sha256": "", "bundle": bundle, "code": "c"}
    folder.mkdir()
    table = pa.Table.from_pylist([{**usual, **of_all, **contact} for contact in contacts], rows.CONTACTS)
    pq.write_table(table, folder / "contacts.parquet")
    return folder


def changed(folder: Path) -> list[str]:
    return pq.read_table(folder / "changes.parquet")["unit"].to_pylist()


def test_nothing_changes_when_nothing_changed(tmp_path):
    old, new = (write(tmp_path / name, {"unit": "1"}, {"unit": "2"}) for name in ("old", "new"))
    found = compare(old, new)
    assert (found.both, found.only_old, found.only_new) == (2, 0, 0)
    assert (found.flips, found.turned, found.changed) == ([], 0, 0)
    assert changed(new) == []


def test_each_kind_of_change_is_counted_and_written_down(tmp_path):
    refused = {"vessel": None, "probability": None, "unknown": None, "heading": None, "error": "expected, got"}
    old = write(
        tmp_path / "old",
        *[{"unit": unit} for unit in ("same", "flip", "unknown", "refused", "shift", "around", "turned", "old")],
        bundle="a",
    )
    new = write(
        tmp_path / "new",
        {"unit": "same", "probability": 0.85, "heading": 3.1 + math.radians(4)},
        {"unit": "flip", "vessel": "rhib"},
        {"unit": "unknown", "unknown": True},
        {"unit": "refused", **refused},
        {"unit": "shift", "probability": 0.7},
        {"unit": "around", "heading": 3.1 - 2 * math.pi + math.radians(6)},
        {"unit": "turned", "heading": 3.1 - math.pi},
        {"unit": "new"},
    )
    found = compare(old, new)
    assert (found.old_bundle, found.new_bundle) == ("a", "b")
    assert (found.both, found.only_old, found.only_new) == (7, 1, 1)
    assert sorted(found.flips, key=lambda flip: flip.new) == [
        Flip("tug", "refused", 1),
        Flip("tug", "rhib", 1),
        Flip("tug", "unknown", 1),
    ]
    assert found.turned == 1
    assert changed(new) == sorted(["flip", "unknown", "refused", "shift", "around", "turned"])
    shifts = np.array([-0.05, 0, 0, -0.2, 0, 0])
    assert found.probability_shift["p10"] == pytest.approx(np.percentile(shifts, 10))
    assert found.heading_shift_deg["p50"] == pytest.approx(np.percentile([4, 0, 0, 0, 6, 180], 50), abs=1e-9)


def test_results_that_cannot_be_read_are_told(tmp_path):
    new = write(tmp_path / "new", {"unit": "1"})
    with pytest.raises(FileError, match=r"expected results in .*old, got no contacts"):
        compare(tmp_path / "old", new)


def test_the_command_compares_and_reports(inputs, tmp_path, engine, capsys):
    assert main(["batch", str(inputs), "--out", str(tmp_path / "old")]) == 1
    engine.bundle = "e" * 64
    answers = engine.answers
    engine.answers = lambda contacts: map(called_rhib, answers(contacts))
    given = ["batch", str(inputs), "--out", str(tmp_path / "new"), "--compare", str(tmp_path / "old")]
    assert main(given) == 1
    assert re.search(r"called\s+12\s+tug -> rhib", capsys.readouterr().out)
    page = (tmp_path / "new/report.html").read_text(encoding="utf-8")
    assert "What changed" in page
    assert len(changed(tmp_path / "new")) == 12
    shutil.rmtree(tmp_path / "old")
    assert main(given) == 2


def called_rhib(answer):
    return answer if isinstance(answer, str) else replace(answer, vessel="rhib")
