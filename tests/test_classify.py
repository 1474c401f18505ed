import os
from pathlib import Path

import numpy as np
import orjson
import pytest

from builders_pipeline import FakePipeline
from builders_recognition import recognised, write_scan
from shipshape.classify import Answered, PictureFolder, Refused, Situation, classify_files, to_record
from shipshape.types import Options

KEYS = [
    "file",
    "index",
    "vessel",
    "probability",
    "probabilities",
    "unknown",
    "reasons",
    "heading",
    "heading_std",
    "bow_probability",
    "aspect_deg",
    "box",
    "measured_points",
    "inferred_points",
    "rung",
    "bundle",
    "stage_ms",
]


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    return write_scan(tmp_path / "scan.npz")


def classified(*files: Path, situation: Situation | None = None):
    pipeline = FakePipeline()
    outcomes = classify_files(files, lambda contact: pipeline.run(contact, Options()), situation or Situation())
    return list(outcomes), pipeline


def test_a_bad_file_and_a_bad_cluster_do_not_end_the_run(scan, tmp_path):
    outcomes, _ = classified(tmp_path / "gone.npy", scan, scan)
    assert [type(outcome) for outcome in outcomes] == [Refused, *[Answered, Refused, Answered] * 2]
    assert [outcome.index for outcome in outcomes] == [None, 0, 1, 2, 0, 1, 2]
    assert outcomes[2].error == "expected at least 10 points in a cluster, got 3"
    assert "got: No such file" in outcomes[0].error


def test_a_file_without_clusters_is_refused(tmp_path):
    np.savez(tmp_path / "empty.npz", points=np.empty((0, 3), np.float32), n=np.empty(0, int))
    (outcome,), _ = classified(tmp_path / "empty.npz")
    assert outcome == Refused(
        tmp_path / "empty.npz", None, 0, "expected at least one cluster in empty.npz, got none"
    )


def test_what_the_caller_knows_reaches_every_contact(scan):
    _, pipeline = classified(scan, situation=Situation(sensor_height=4.5, own_true_heading_deg=270.0))
    contacts = [contact for contact, _ in pipeline.seen]
    assert [contact.sensor_height for contact in contacts] == [4.5, 4.5]
    assert [contact.own_true_heading_deg for contact in contacts] == [270.0, 270.0]
    assert [contact.contact_id for contact in contacts] == ["scan-0000", "scan-0002"]


def test_a_record_has_exactly_the_promised_keys_and_is_json(scan):
    (answered, refused, _), _ = classified(scan)
    record = to_record(answered)
    assert list(record) == KEYS
    assert list(record["box"]) == ["center", "length", "beam", "height"]
    assert orjson.loads(orjson.dumps(record)) == record
    assert to_record(refused) == {"file": str(scan), "index": 1, "error": refused.error}


def test_a_true_heading_is_recorded_when_the_own_heading_is_known(scan):
    (answered, *_), _ = classified(scan, situation=Situation(own_true_heading_deg=90.0))
    assert list(to_record(answered)) == [*KEYS, "true_heading_deg"]


def test_pictures_never_overwrite_each_other(tmp_path):
    contact, recognition = recognised()
    pictures = PictureFolder(tmp_path)
    names = [
        pictures.path(Answered(Path(file), index, total, contact, recognition)).name
        for file, index, total in [
            ("a/tug.npy", 0, 1),
            ("b/tug.csv", 0, 1),
            ("scan.npz", 12, 20_000),
            ("s.npz", 0, 2),
        ]
    ]
    assert names == ["tug.png", "tug_2.png", "scan-00012.png", "s-0000.png"]


def test_a_file_name_that_is_no_utf8_is_told_with_a_mark_in_its_place(scan, tmp_path):
    odd = tmp_path / os.fsdecode(b"t\xfcg.npz")
    scan.rename(odd)
    (answered, refused, _), _ = classified(odd)
    assert answered.contact.contact_id == "t\ufffdg-0000"
    assert to_record(answered)["file"] == str(tmp_path / "t\ufffdg.npz")
    assert orjson.dumps(to_record(answered))
    assert orjson.dumps(to_record(refused))
    (gone,), _ = classified(tmp_path / os.fsdecode(b"g\xf6ne.npy"))
    assert "expected to read g\ufffdne.npy" in to_record(gone)["error"]
    assert orjson.dumps(to_record(gone))
