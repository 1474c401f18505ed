"""A run that was stopped at any moment goes on and ends with the same bytes as one that was not."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest

from batch.written import write_inputs
from shipshape.batch import command
from shipshape.batch.results import open_results
from shipshape.cli import main

MODELS = Path(__file__).parents[2] / "models"
needs_models = pytest.mark.skipif(
    not (MODELS / "manifest.toml").exists(), reason="the default bundle (models/) is not trained yet"
)
# The command itself, in chunks so small that a short run has many moments to be killed at.
SMALL_CHUNKS = """
import sys
from shipshape.batch import reading
from shipshape.cli import main
reading.CHUNK_CLOUDS = 3
sys.exit(main(sys.argv[1:]))
"""


class Killed(BaseException):
    """The process ends here, whatever it wanted to do next."""


def tables(folder: Path) -> bytes:
    return (folder / "contacts.parquet").read_bytes()


def run(inputs: Path, out: Path, *more: str) -> int:
    return main(["batch", str(inputs), "--out", str(out), "--restored", *more])


def stop_at(monkeypatch, write: int, *, after: bool) -> None:
    """Be killed at that write of a file: before it gets its name, or right after."""
    writes = 0
    rename = Path.replace

    def replace(path: Path, target: Path) -> Path:
        nonlocal writes
        writes += 1
        if writes == write and not after:
            raise Killed
        renamed = rename(path, target)
        if writes == write:
            raise Killed
        return renamed

    monkeypatch.setattr(Path, "replace", replace)


def test_a_run_killed_at_each_of_its_writes_ends_with_the_same_bytes(tmp_path, engine, monkeypatch):
    inputs = write_inputs(tmp_path / "inputs", messages=6, clusters=5)
    monkeypatch.setattr(command, "to_page", lambda report: "")  # plots take longer than all the rest
    assert run(inputs, tmp_path / "whole") == 1
    whole, contacts = tables(tmp_path / "whole"), engine.computed
    assert contacts == 11
    writes = 0
    for after in (False, True):
        for write in range(1, 100):
            out = tmp_path / f"{write}-{after}"
            with monkeypatch.context() as patch:
                stop_at(patch, write, after=after)
                try:
                    run(inputs, out)
                    break  # it has fewer writes than that
                except Killed:
                    writes += 1
            assert run(inputs, out) == 1
            assert tables(out) == whole
            assert not list(out.rglob("*.tmp"))
    assert writes > 20


def test_a_part_is_computed_once(inputs, tmp_path, engine, monkeypatch):
    with monkeypatch.context() as patch:
        stop_at(patch, 8, after=True)
        with pytest.raises(Killed):
            run(inputs, tmp_path / "out")
    kept = sum(pq.read_metadata(part).num_rows for part in (tmp_path / "out/parts").glob("*.parquet"))
    assert kept > 8
    engine.computed = 0
    run(inputs, tmp_path / "out")
    assert engine.computed == 25 - kept


def test_a_finished_run_is_given_again_without_computing(inputs, tmp_path, engine, capsys):
    run(inputs, tmp_path / "out")
    first, whole = capsys.readouterr().out, tables(tmp_path / "out")
    engine.computed = 0
    run(inputs, tmp_path / "out")
    assert engine.computed == 0
    assert capsys.readouterr().out == first
    assert tables(tmp_path / "out") == whole


def test_inputs_can_be_added_and_renamed(inputs, tmp_path, engine):
    (inputs / "b.mcap").rename(tmp_path / "later.mcap")
    run(inputs, tmp_path / "out")
    (tmp_path / "later.mcap").rename(inputs / "renamed.mcap")
    (inputs / "a.npz").rename(inputs / "other.npz")
    engine.computed = 0
    run(inputs, tmp_path / "out")
    assert engine.computed == 15
    table = pq.read_table(tmp_path / "out/contacts.parquet")
    names = {Path(name).name: count for name, count in np.stack(np.unique(table["input"], return_counts=True), 1)}
    assert names == {"other.npz": 10, "renamed.mcap": 15}


def test_results_of_something_else_are_not_added_to(inputs, tmp_path, engine, capsys):
    run(inputs, tmp_path / "out")
    engine.bundle = "e" * 64
    assert run(inputs, tmp_path / "out") == 2
    assert run(inputs, tmp_path / "out", "--sensor-height", "3") == 2
    bundle, height = capsys.readouterr().err.splitlines()
    start = f"shipshape: expected {tmp_path / 'out'} to be of the same"
    assert bundle.startswith(f"{start} bundle, {'e' * 20}..., got results of {'f' * 20}...: choose another --out")
    assert height.startswith(f"{start} bundle")
    engine.bundle = "f" * 64
    assert run(inputs, tmp_path / "out", "--sensor-height", "3") == 2
    assert capsys.readouterr().err.startswith(f"{start} sensor_height, 3.0, got results of None: choose another")


def test_two_runs_do_not_share_a_folder(inputs, tmp_path, engine, capsys):
    with open_results(tmp_path / "out", {"bundle": "f"}, clouds=False):
        assert run(inputs, tmp_path / "out") == 2
    assert f"expected {tmp_path / 'out'} to be free, got another run" in capsys.readouterr().err


def test_a_folder_of_something_else_is_left_alone(inputs, tmp_path, engine, capsys):
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "letter.tmp").write_text("dear")
    assert run(inputs, tmp_path / "home") == 2
    assert "home to be empty or to hold results, got letter.tmp in it" in capsys.readouterr().err
    assert (tmp_path / "home" / "letter.tmp").exists()


def test_a_damaged_part_is_told(inputs, tmp_path, engine, capsys):
    run(inputs, tmp_path / "out")
    part = min((tmp_path / "out/parts").iterdir())
    part.write_bytes(part.read_bytes()[:-5])
    assert run(inputs, tmp_path / "out") == 2
    sentence = f"expected parts/{part.name} to be whole, got a damaged file: delete it and run again"
    assert sentence in capsys.readouterr().err
    part.unlink()
    assert run(inputs, tmp_path / "out") == 1


@needs_models
def test_the_command_killed_at_random_moments_ends_with_the_same_bytes(tmp_path):
    folder = write_inputs(tmp_path / "inputs", messages=12, clusters=12)
    words = [sys.executable, "-c", SMALL_CHUNKS, "batch", str(folder), "--bundle", str(MODELS), "--workers", "2"]

    def start(out: Path) -> subprocess.Popen:
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        return subprocess.Popen([*words, "--out", out], **quiet, start_new_session=True)

    assert main([*words[3:], "--out", str(tmp_path / "whole")]) == 1
    whole = tables(tmp_path / "whole")
    assert len(pq.read_table(tmp_path / "whole/contacts.parquet")) == 24
    rng, out = np.random.default_rng(5), tmp_path / "killed"
    kills = 0
    while True:
        before = len(list(out.glob("parts/*.parquet")))
        wanted = before + int(rng.integers(1, 4))  # parts; the moment after is chance
        running = start(out)
        while running.poll() is None and len(list(out.glob("parts/*.parquet"))) < wanted:
            time.sleep(0.002)  # leaves the cores to the run
        if running.poll() is not None:
            break
        running.kill()  # the parent alone: its workers must not outlive it
        running.wait()
        wait_for_the_end_of(running.pid)
        kills += 1
    assert running.returncode == 1
    assert kills >= 1
    assert tables(out) == whole


def wait_for_the_end_of(group: int) -> None:
    """Until no process of the group runs."""
    while any(runs_in(process, group) for process in psutil.process_iter()):
        time.sleep(0.002)


def runs_in(process: psutil.Process, group: int) -> bool:
    try:
        return os.getpgid(process.pid) == group and process.status() != psutil.STATUS_ZOMBIE
    except (ProcessLookupError, psutil.NoSuchProcess):
        return False


# Ctrl-C may come between the opening of a file and the block that closes it.
@pytest.mark.filterwarnings("ignore:Exception ignored in. <_io.FileIO:pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_ends_a_run_that_can_go_on(inputs, tmp_path, engine, monkeypatch):
    calls = 0
    answers = engine.answers

    def interrupted(contacts):
        nonlocal calls
        calls += 1
        if calls == 4:
            signal.raise_signal(signal.SIGINT)
        return answers(contacts)

    monkeypatch.setattr(engine, "answers", interrupted)
    assert run(inputs, tmp_path / "out") == 130
    monkeypatch.setattr(engine, "answers", answers)
    assert run(inputs, tmp_path / "out") == 1
    run(inputs, tmp_path / "whole")
    assert tables(tmp_path / "out") == tables(tmp_path / "whole")
