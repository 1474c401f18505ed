import json
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from batch.written import cloud, packed, write_mcap, write_ros2
from builders_recognition import side_of_hull
from shipshape.batch import reading, rows
from shipshape.bundle import load_bundle
from shipshape.cli import main
from shipshape.pipeline import Pipeline
from shipshape.pointfiles import read_clusters
from shipshape.types import Contact, Options, Rung

ROOT = Path(__file__).parents[2]
MODELS, SCAN = ROOT / "models", ROOT / "examples" / "contacts.npz"
LIDAR = ROOT.parent / "shared" / "data" / "lidar"
needs_models = pytest.mark.skipif(
    not (MODELS / "manifest.toml").exists(), reason="the default bundle (models/) is not trained yet"
)
HULL = side_of_hull(0.5, (40.0, 5.0, -3.0))


def run(*arguments: object) -> int:
    return main(["batch", *map(str, arguments)])


def table_of(out: Path) -> list[dict]:
    return pq.read_table(out / "contacts.parquet").to_pylist()


def summary_of(out: Path) -> dict:
    return json.loads((out / "summary.json").read_bytes())


@needs_models
def test_rows_are_what_the_pipeline_says(tmp_path):
    out = tmp_path / "out"
    assert run(SCAN, "--out", out, "--bundle", MODELS, "--sensor-height", 3, "--workers", 2, "--restored") == 0
    pipeline = Pipeline(load_bundle(MODELS))
    clouds = pq.read_table(out / "clouds").to_pylist()
    found = table_of(out)
    assert len(found) == len(clouds) == 6
    for row, restored, points in zip(found, clouds, read_clusters(SCAN), strict=True):
        said = pipeline.run(Contact(points, sensor_height=3.0), Options(lowest_rung=Rung.FULL))
        assert (row["vessel"], row["probability"], row["unknown"]) == (said.vessel, said.probability, said.unknown)
        assert (row["heading"], row["aspect_deg"], row["points"]) == (said.heading, said.aspect_deg, len(points))
        assert (row["box_x"], row["box_y"], row["box_z"]) == said.box.center_level
        assert dict(row["probabilities"]) == dict(said.probabilities)
        assert row["reasons"] == list(said.reasons)
        assert (row["measured_points"], row["inferred_points"]) == (said.measured_points, said.inferred_points)
        assert (row["bundle"], row["error"]) == (said.bundle, None)
        assert restored["unit"] == row["unit"]
        cloud_points = np.column_stack([restored[axis] for axis in "xyz"]).astype(np.float32)
        np.testing.assert_array_equal(cloud_points, said.restored.points_level)
        assert restored["measured"] == said.restored.measured.tolist()
    assert {stage for stage, _ in pq.read_table(out / "timings.parquet").to_pylist()[0]["stage_ms"]} == {
        stage.name for stage in pipeline.stages
    }


def test_the_table_has_the_columns_and_the_version_of_its_schema(inputs, tmp_path, engine):
    run(inputs, "--out", tmp_path / "out")
    schema = pq.read_schema(tmp_path / "out/contacts.parquet")
    assert schema.names == ["input", *rows.COLUMNS.names]
    assert schema.metadata[b"shipshape.batch.schema"] == b"1"
    documented = (ROOT / "docs/batch.md").read_text(encoding="utf-8")
    assert [name for name in schema.names if f"`{name}`" not in documented] == []


def test_each_row_has_an_id_of_its_own_and_is_in_the_order_of_the_inputs(inputs, tmp_path, engine):
    run(inputs, "--out", tmp_path / "out")
    found = table_of(tmp_path / "out")
    assert len({row["unit"] for row in found}) == len(found) == 25
    places = [(Path(row["input"]).name, row["message"], row["cluster"]) for row in found]
    assert places == [("a.npz", 0, index) for index in range(10)] + [("b.mcap", index, 0) for index in range(15)]
    assert found[10]["topic"] == "/points"
    assert found[10]["stamp"].timestamp() == 1_700_000_000


def test_what_is_refused_is_told_and_ends_nothing(inputs, tmp_path, engine, capsys):
    assert run(inputs, inputs / "gone.npy", "--out", tmp_path / "out") == 1
    (refused,) = [row for row in table_of(tmp_path / "out") if row["error"]]
    assert refused["error"] == "expected at least 10 points in a cluster, got 5"
    assert (refused["vessel"], refused["points"], refused["cluster"]) == (None, 5, 3)
    summary = summary_of(tmp_path / "out")
    assert (summary["contacts"], summary["answered"], summary["refused"]) == (25, 24, 1)
    assert summary["refusals"] == {"expected at least 10 points in a cluster": 1}
    errors = {Path(record["name"]).name: record["error"] for record in summary["inputs"] if record["error"]}
    assert sorted(errors) == ["c.bag", "gone.npy"]
    assert errors["c.bag"].startswith("expected c.bag to be a complete recording, got: ")
    assert errors["gone.npy"] == f"expected to read {inputs / 'gone.npy'}, got: No such file or directory"
    told = capsys.readouterr().out
    assert all(error in told for error in errors.values())
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert "expected c.bag to be a complete recording" in page
    assert "<script" not in page
    assert not re.search(r"(src|href)=.?http|url[(](?!#)", page)


def test_inputs_that_are_all_read_are_a_success(tmp_path, engine):
    np.save(tmp_path / "hull.npy", HULL)
    assert run(tmp_path / "hull.npy", "--out", tmp_path / "out") == 0


def test_what_comes_before_a_break_is_kept(tmp_path, engine):
    rng = np.random.default_rng(0)
    clouds = [cloud(packed(HULL + rng.normal(0, 0.01, HULL.shape).astype(np.float32))) for _ in range(20)]
    whole = write_mcap(tmp_path / "whole.mcap", clouds, chunk=2000)
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    assert run(tmp_path / "cut.mcap", "--out", tmp_path / "out") == 1
    (record,) = summary_of(tmp_path / "out")["inputs"]
    assert record["error"].startswith("expected cut.mcap to be a complete recording")
    assert 5 < record["contacts"] < 15
    engine.computed = 0
    assert run(tmp_path / "cut.mcap", "--out", tmp_path / "out") == 1
    assert engine.computed == 0


def test_a_message_that_makes_no_sense_has_a_row_with_the_reason(tmp_path, engine):
    flat = cloud(packed(HULL)[["x", "y"]].copy())
    write_mcap(tmp_path / "a.mcap", [flat, cloud(packed(HULL))])
    assert run(tmp_path / "a.mcap", "--out", tmp_path / "out") == 0
    first, second = table_of(tmp_path / "out")
    assert (first["error"], first["cluster"]) == ("expected one field each of x, y and z, got x, y", None)
    assert (second["error"], second["cluster"]) == (None, 0)


def test_a_copy_of_an_input_has_no_rows_of_its_own(inputs, tmp_path, engine):
    shutil.copy(inputs / "a.npz", inputs / "z.npz")
    run(inputs, "--out", tmp_path / "out")
    assert len(table_of(tmp_path / "out")) == 25
    (copy,) = [record for record in summary_of(tmp_path / "out")["inputs"] if record["same_as"]]
    assert (Path(copy["name"]).name, Path(copy["same_as"]).name) == ("z.npz", "a.npz")


def test_a_name_that_says_no_kind_does_not_hide_the_same_content_under_another(tmp_path, engine):
    for name in ("a.dat", "b.npz"):
        shutil.copy(SCAN, tmp_path / name)
    assert run(tmp_path / "a.dat", tmp_path / "b.npz", "--out", tmp_path / "out") == 1
    first, second = summary_of(tmp_path / "out")["inputs"]
    assert first["error"].startswith("expected a file ending in .npy .npz")
    assert first["error"].endswith(".parquet .bag .db3 .mcap, got a.dat")
    assert second["contacts"] == 6


def test_links_that_lead_round_in_circles_are_followed_once(inputs, tmp_path, engine):
    for name in ("round", "and_round"):
        (inputs / name).symlink_to(inputs)
    assert run(inputs, "--out", tmp_path / "out") == 1
    assert len(summary_of(tmp_path / "out")["inputs"]) == 3


def test_a_pipe_is_refused_and_not_waited_for(tmp_path, engine):
    os.mkfifo(tmp_path / "pipe.pcd")
    assert run(tmp_path / "pipe.pcd", SCAN, "--out", tmp_path / "out") == 1
    pipe, scan = summary_of(tmp_path / "out")["inputs"]
    assert pipe["error"].endswith("pipe.pcd, got: something that is neither file nor folder")
    assert scan["contacts"] == 6


def test_names_of_clusters_are_kept(tmp_path, engine):
    other = HULL + np.float32([0, 30, 0])
    write_mcap(tmp_path / "a.mcap", [cloud(packed(np.concatenate([HULL, other]), np.repeat([7, 9], len(HULL))))])
    run(tmp_path / "a.mcap", "--out", tmp_path / "out", "--segment")
    assert [(row["contact_id"], row["points"]) for row in table_of(tmp_path / "out")] == [("7", 80), ("9", 80)]


def test_folders_are_searched_and_a_folder_of_ros_2_is_one_input(tmp_path, engine):
    night = tmp_path / "night"
    (night / "deep").mkdir(parents=True)
    np.save(night / "deep" / "hull.npy", HULL)
    write_ros2(night / "bag", [cloud(packed(HULL))])
    (night / "notes.txt").write_text("no points")
    assert run(night, "--out", night / "results") == 0
    assert run(night, "--out", night / "results") == 0  # its own tables are no inputs
    names = [record["name"] for record in summary_of(night / "results")["inputs"]]
    assert names == [str(night / "bag"), str(night / "deep" / "hull.npy")]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--service", "x", "--ray", "y"], "expected --service or --ray, got both"),
        (["--gap", "3"], "expected --segment beside --gap, got it alone"),
        (["--segment", "--gap", "-1"], "expected --gap of 0.01 or more, got -1.0"),
        (["--workers", "0"], "expected --workers of 1 to 1024, got 0"),
        (["--image-method", "full_top"], "expected --image-method with --preset paper alone, got --preset best"),
        (["--sensor-height", "-3"], "expected --sensor-height between 0 and 200 m, got -3.0"),
        (
            ["--bundle", "nowhere"],
            "expected a bundle folder at nowhere, got nothing: --bundle or SHIPSHAPE_BUNDLE names another",
        ),
        (["--service", "nowhere"], "expected an endpoint like grpc://127.0.0.1:50051, got 'nowhere'"),
        (["--compare", "nowhere"], "expected results of a finished run in nowhere, got no contacts.parquet"),
    ],
)
def test_a_wrong_command_gets_one_sentence(tmp_path, capsys, arguments, sentence):
    np.save(tmp_path / "hull.npy", HULL)
    assert run(tmp_path / "hull.npy", "--out", tmp_path / "out", *arguments) == 2
    assert capsys.readouterr().err == f"shipshape: {sentence}\n"
    assert not (tmp_path / "out").exists()


def test_results_are_not_compared_with_themselves(tmp_path, engine, capsys):
    out = tmp_path / "out"
    assert run(SCAN, "--out", out) == 0
    capsys.readouterr()
    assert run(SCAN, "--out", out, "--compare", out / ".." / "out") == 2
    assert capsys.readouterr().err == (
        f"shipshape: expected another folder in --compare than in --out, got {out} in both\n"
    )


def test_a_fault_in_a_reader_does_not_end_the_run(tmp_path, engine, monkeypatch, caplog):
    for name in ("a", "b"):
        np.save(tmp_path / f"{name}.npy", HULL + (name == "b"))
    whole = reading.read_named_clusters

    def broken(path, **arguments):
        if path.name == "a.npy":
            raise ZeroDivisionError
        return whole(path, **arguments)

    monkeypatch.setattr(reading, "read_named_clusters", broken)
    assert run(tmp_path / "a.npy", tmp_path / "b.npy", "--out", tmp_path / "out") == 1
    assert len(table_of(tmp_path / "out")) == 1
    record = summary_of(tmp_path / "out")["inputs"][0]
    assert record["error"] == "expected a.npy to be readable, got a fault of Shipshape: ZeroDivisionError"
    assert "ZeroDivisionError" in caplog.text


def test_a_folder_without_inputs_is_told(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert run(tmp_path / "empty", "--out", tmp_path / "out") == 2
    assert "expected files of points or recordings in INPUT" in capsys.readouterr().err


@pytest.mark.skipif(not LIDAR.is_dir(), reason="the real scans beside the checkout (../shared/data) are absent")
def test_every_real_file_is_read_or_refused_and_none_ends_the_run(tmp_path, engine):
    assert run(LIDAR, "--out", tmp_path / "out", "--segment") == 1
    records = summary_of(tmp_path / "out")["inputs"]
    assert len(records) > 40
    assert {Path(record["name"]).name for record in records if record["error"]} == {
        "512x10_raw.bag",
        "ascii_empty.pcd",
        "ascii_invalid_header.pcd",
        "diamond.npz",
        "trout_ship_boxes.csv",
    }
    assert {record["error"].split()[0] for record in records if record["error"]} == {"expected"}
