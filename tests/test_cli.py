import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from builders_onnx import write_tiny_bundle
from builders_pipeline import FakePipeline, fake_bundle
from builders_recognition import side_of_hull, write_scan
from shipshape import commands, serve
from shipshape.cli import build_parser, main
from shipshape.pointfiles import SUFFIXES
from shipshape.sample import sample_contact
from shipshape.types import ImageMethod, Preset

MODELS = Path(__file__).parents[1] / "models"
LIDAR = Path(__file__).parents[2] / "shared" / "data" / "lidar"
needs_models = pytest.mark.skipif(
    not (MODELS / "manifest.toml").exists(), reason="the default bundle (models/) is not trained yet"
)


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    return write_scan(tmp_path / "scan.npz")


@pytest.fixture
def cluster(tmp_path: Path) -> Path:
    np.save(tmp_path / "cluster.npy", side_of_hull(0.5, (40.0, 5.0, -3.0)))
    return tmp_path / "cluster.npy"


@pytest.fixture
def pipeline(monkeypatch) -> FakePipeline:
    fake = FakePipeline()
    monkeypatch.setattr(commands, "_open", lambda folder: (fake_bundle(), fake))
    return fake


def test_the_table_names_every_cluster_and_the_exit_code_tells_of_the_refused_one(scan, pipeline, capsys):
    assert main(["classify", str(scan)]) == 1
    title, first, second, third = capsys.readouterr().out.splitlines()
    assert title.split()[:3] == ["contact", "vessel", "prob."]
    assert first.startswith(f"{scan} 0 ")
    assert "pilot_boat" in first
    assert "97.0%" in first
    assert "+28.6 ± 2.0°" in first
    assert "12.0 x 4.0 x 3.0" in first
    assert second.endswith("refused: expected at least 10 points in a cluster, got 3")
    assert third.startswith(f"{scan} 2 ")


def test_an_unknown_vessel_is_called_so(cluster, pipeline, capsys):
    pipeline.unknown = True
    assert main(["classify", str(cluster)]) == 0
    assert "unknown (most like pilot_boat)   69.0%" in capsys.readouterr().out


def test_json_is_one_object_a_cluster_and_line(scan, cluster, tmp_path, pipeline, capsys):
    assert main(["classify", "--json", str(scan), str(cluster), str(tmp_path / "gone.npy")]) == 1
    records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [record.get("vessel") for record in records] == ["pilot_boat", None, "pilot_boat", "pilot_boat", None]
    assert [record["index"] for record in records] == [0, 1, 2, 0, None]
    assert list(records[-1]) == ["file", "index", "error"]


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        (np.empty((0, 3)), "at least 10 points in a cluster, got 0"),
        (np.full((50, 3), np.nan), "got 50 points with NaN or infinity"),
        (np.full((50, 3), 1e300), "got 50 points with NaN or infinity"),
        (np.ones((50, 2)), "floats of shape (N, 3), got float64 of shape (50, 2)"),
        (np.ones((1_000_000, 3), np.float32), "at most 65536 points in a cluster, got 1000000"),
        (np.linspace((100, 0, 0), (5100, 0, 0), 50), "got 5000.0 m"),
    ],
    ids=["empty", "nan", "beyond float32", "two columns", "a million", "five kilometres"],
)
def test_what_is_no_cluster_is_refused_in_one_sentence(points, sentence, tmp_path, pipeline, capsys):
    np.save(tmp_path / "bad.npy", points)
    assert main(["classify", "--json", str(tmp_path / "bad.npy")]) == 1
    record = json.loads(capsys.readouterr().out)
    assert record["error"].startswith("expected ")
    assert sentence in record["error"]


def test_progress_counts_on_the_terminal_while_the_answers_go_elsewhere(scan, pipeline, monkeypatch, capsys):
    monkeypatch.setattr(commands, "PROGRESS_STEP_S", 0.0)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    main(["classify", str(scan), "--json"])
    shown = capsys.readouterr()
    assert "3/3 scan.npz" in shown.err
    assert len(shown.out.splitlines()) == 3


def test_one_picture_a_recognised_cluster(scan, tmp_path, pipeline, capsys):
    main(["classify", str(scan), "--png", str(tmp_path / "new" / "pictures")])
    pictures = sorted((tmp_path / "new" / "pictures").iterdir())
    assert [path.name for path in pictures] == ["scan-0000.png", "scan-0002.png"]
    assert cv2.imread(str(pictures[0])).shape == (900, 1600, 3)


@pytest.mark.parametrize("form", [[], ["--json"]], ids=["table", "json"])
def test_a_file_name_that_is_no_utf8_is_drawn_and_printed(form, cluster, tmp_path, pipeline, capsys):
    odd = tmp_path / os.fsdecode(b"t\xfcg.npy")
    cluster.rename(odd)
    assert main(["classify", str(odd), "--png", str(tmp_path / "pictures"), *form]) == 0
    assert "t\ufffdg.npy" in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "pictures").iterdir()] == ["t\ufffdg.png"]


def test_a_picture_folder_that_cannot_be_is_a_usage_error(cluster, pipeline, capsys):
    assert main(["classify", str(cluster), "--png", str(cluster)]) == 2
    assert "expected to write pictures into" in capsys.readouterr().err


def test_preset_image_method_and_own_heading_reach_the_pipeline(cluster, pipeline, capsys):
    argv = [
        "--preset",
        "paper",
        "--image-method",
        "z_top",
        "--own-heading",
        "90",
        "--sensor-height",
        "2.5",
        "--json",
    ]
    assert main(["classify", str(cluster), *argv]) == 0
    contact, options = pipeline.seen[-1]
    assert (options.preset, options.image_method) == (Preset.PAPER, ImageMethod.Z_TOP)
    assert (contact.sensor_height, contact.own_true_heading_deg) == (2.5, 90.0)
    assert json.loads(capsys.readouterr().out)["true_heading_deg"] == pytest.approx(61.352, abs=1e-3)


def test_an_image_method_without_preset_paper_is_a_usage_error(cluster, pipeline, capsys):
    assert main(["classify", str(cluster), "--image-method", "z_top"]) == 2
    assert "expected --image-method with --preset paper alone" in capsys.readouterr().err


@pytest.mark.parametrize(
    "argv", [[], ["classify"], ["classify", "x.npy", "--preset", "worst"], ["bundle"], ["sail"]]
)
def test_a_wrong_command_line_exits_with_2(argv, capsys):
    with pytest.raises(SystemExit) as caught:
        main(argv)
    assert caught.value.code == 2
    assert re.search(r"; see `shipshape.* --help`$", capsys.readouterr().err)


@pytest.mark.parametrize(
    "argv", [["--help"], *[[*name.split(), "--help"] for name in commands.COMMANDS], ["--version"]], ids=str
)
def test_every_command_has_help(argv, capsys):
    with pytest.raises(SystemExit) as caught:
        main(argv)
    assert caught.value.code == 0
    shown = capsys.readouterr().out
    assert "example" in shown or argv == ["--version"]


def test_every_example_in_a_help_text_is_a_command_that_parses():
    for parser in parsers(build_parser()):
        lines = re.findall(r"^  shipshape (.+)$", parser.epilog, re.M)
        assert lines, parser.prog
        for line in lines:
            build_parser().parse_args(shlex.split(line.partition(" | ")[0], comments=True))


def parsers(parser):
    """A parser and those of all its commands."""
    yield parser
    for action in parser._actions:
        for child in action.choices.values() if isinstance(action.choices, dict) else ():
            yield from parsers(child)


def test_check_prints_bundle_answer_and_stages(pipeline, capsys):
    assert main(["check"]) == 0
    shown = capsys.readouterr().out
    assert "bundle fake (ffffffffffff): rhib, tug" in shown
    assert "inpainting          0.40 ms" in shown
    assert "median of 20 runs on 1000 points" in shown


def test_bundle_verify_prints_the_signatures(tmp_path, monkeypatch, capsys):
    write_tiny_bundle(tmp_path / "bundle")
    monkeypatch.setattr(commands, "Pipeline", lambda bundle: FakePipeline())
    assert main(["bundle", "verify", str(tmp_path / "bundle")]) == 0
    assert "prior: x float32[-1, 3] -> doubled float32[-1, 3], sums float32[-1]" in capsys.readouterr().out


def test_bundle_verify_misses_what_the_pipeline_needs(tmp_path, capsys):
    write_tiny_bundle(tmp_path / "bundle")
    assert main(["bundle", "verify", str(tmp_path / "bundle")]) == 2
    assert "shipshape: expected " in capsys.readouterr().err


@pytest.mark.parametrize("command", [["bundle", "verify", "x"], ["check"], ["classify", "x.npy"]])
def test_a_bundle_that_breaks_the_run_exits_with_2_and_one_sentence(command, pipeline, monkeypatch, capsys):
    def broken(contact, options):
        raise ValueError("not enough values to unpack (expected 5, got 1)")

    pipeline.run = broken
    monkeypatch.setattr(commands, "load_bundle", lambda folder: fake_bundle())
    monkeypatch.setattr(commands, "Pipeline", lambda bundle: pipeline)
    assert main(command) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("shipshape: expected the bundle to answer the built-in cluster, got ValueError: not ")
    assert shown.count("\n") == 1


@pytest.mark.parametrize(
    "command", [["classify", "x.npy", "--bundle"], ["check", "--bundle"], ["bundle", "verify"]]
)
def test_a_missing_bundle_exits_with_2_and_one_sentence(command, tmp_path, capsys):
    assert main([*command, str(tmp_path / "gone")]) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("shipshape: expected a bundle folder at ")
    assert shown.count("\n") == 1


def test_serve_hands_its_options_to_the_service(monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(serve, "serve_until_signal", lambda settings: seen.append(settings) or 0)
    assert main(["serve", "--rest-port", "0", "--grpc-port", "0", "--bundle", str(tmp_path)]) == 0
    assert (seen[0].rest_port, seen[0].grpc_port, seen[0].bundle) == (0, 0, tmp_path)


def test_a_setting_that_cannot_work_exits_with_2(monkeypatch, capsys):
    monkeypatch.setattr(serve, "serve_until_signal", lambda settings: 0)
    assert main(["serve", "--rest-port", "99999"]) == 2
    assert "SHIPSHAPE_REST_PORT, got 99999" in capsys.readouterr().err


def test_the_sample_cluster_is_one_that_the_pipeline_takes(pipeline):
    contact = sample_contact()
    assert contact.points_level.shape == (1000, 3)
    assert contact.points_level.dtype == np.float32
    assert pipeline.run(contact, commands.Options())


def test_a_reader_that_leaves_is_no_error(scan):
    script = (
        "import sys; from builders_pipeline import *; from shipshape.cli import main; "
        "use_fake_pipeline(FakePipeline()); sys.exit(main(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", script, "classify", *[str(scan)] * 50]
    tests = str(Path(__file__).parent)
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={"PYTHONPATH": tests}
    ) as process:
        assert process.stdout.readline().startswith("contact")
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait(timeout=30) == 0


@needs_models
def test_the_default_bundle_recognises_the_sample(tmp_path, capsys):
    np.save(tmp_path / "sample.npy", sample_contact().points_level)
    assert main(["classify", str(tmp_path / "sample.npy"), "--sensor-height", "3", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["vessel"] == "pilot_boat"


@needs_models
@pytest.mark.skipif(not LIDAR.is_dir(), reason="the real scans beside the checkout (../shared/data) are absent")
def test_no_real_file_that_is_not_a_vessels_cluster_is_called_a_vessel(capsys):
    files = sorted(path for path in LIDAR.rglob("*") if path.suffix in SUFFIXES)
    assert main(["classify", "--json", *map(str, files)]) == 1
    records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(records) == len(files) > 25
    assert [record for record in records if not record.get("error", "").startswith("expected ")] == []
