"""A recording ten times as long takes no more memory, read in one process and computed in another."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from batch.written import cloud, packed, write_mcap
from builders_recognition import side_of_hull
from shipshape.batch import reading
from shipshape.batch.method import Method
from shipshape.batch.processes import AHEAD, POINTS_AHEAD, run_ahead
from shipshape.batch.reading import read
from shipshape.batch.units import Chunk, Cloud, Ending, Part, Source

SHORT, LONG = 40, 240  # messages of 1.2 MB
POINTS = 100_000

# Peak resident memory of a whole run with answers that cost nothing, in MB.
PEAK = """
import resource, sys
import batch.fakes
from shipshape.batch import command
command.engine_of = lambda arguments, method: batch.fakes.FakeEngine(None)
from shipshape.cli import main
assert main(["batch", sys.argv[1], "--out", sys.argv[2]]) == 0
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""

# Workers find the object that their parent made where it was made.
FORKED = """
import os
from shipshape.batch.processes import fork_workers, run_in_processes
from shipshape.batch.units import Chunk, Part
loaded = object()
def work(chunk):
    return Part(chunk.sha256, f"{id(loaded)} {os.getppid()}", 0.0, 0, 0, b"")
executor = fork_workers(work, 2)
parts = list(run_in_processes(executor, 2, [Chunk("0" * 64, number, [], 0.0) for number in range(8)]))
assert {part.name for part in parts} == {f"{id(loaded)} {os.getpid()}"}
"""

DYING = """
import os
from shipshape.batch.processes import fork_workers, run_in_processes
from shipshape.batch.units import Chunk
from shipshape.errors import ShipshapeError
executor = fork_workers(lambda chunk: os._exit(9), 2)
try:
    list(run_in_processes(executor, 2, [Chunk("0" * 64, 0, [], 0.0)]))
except ShipshapeError as error:
    print(error)
"""


def write_scans(path, messages):
    rng = np.random.default_rng(0)
    hull = side_of_hull(0.5, (40.0, 5.0, -3.0), POINTS)

    def clouds():
        for _ in range(messages):
            yield cloud(packed((hull + rng.normal(0, 0.05, 3)).astype(np.float32)))

    return write_mcap(path, clouds(), chunk=2**22)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scans")
    return [write_scans(folder / f"{messages}.mcap", messages) for messages in (SHORT, LONG)]


def test_memory_does_not_grow_with_the_input(recordings, tmp_path):
    paths = os.pathsep.join(path for path in sys.path if path)
    peaks = []
    for recording in recordings:
        command = [sys.executable, "-c", PEAK, str(recording), str(tmp_path / recording.stem)]
        ran = subprocess.run(
            command, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True, check=False
        )
        assert ran.returncode == 0, ran.stderr
        peaks.append(float(ran.stdout.splitlines()[-1]))
    grown = recordings[1].stat().st_size - recordings[0].stat().st_size
    assert grown > 200e6
    assert peaks[1] - peaks[0] < 40  # MB; the input grew by more than 200


def test_reading_waits_for_the_workers():
    """No more chunks are read than a few ahead of the one that was taken last."""
    read_so_far = 0

    def chunks():
        nonlocal read_so_far
        for number in range(50):
            read_so_far += 1
            yield Chunk("0" * 64, number, [], 0.0)
        yield Ending("0" * 64, 50, 50)

    def work(chunk):
        return Part(chunk.sha256, chunk.name, 0.0, 0, 0, b"")

    taken = []
    for item in run_ahead(ThreadPoolExecutor(1), work, chunks(), AHEAD):
        taken.append(item)
        assert read_so_far - len(taken) <= AHEAD + 1
    assert [item.name for item in taken[:-1]] == [f"{'0' * 16}-{number:06d}" for number in range(50)]
    assert isinstance(taken[-1], Ending)


def test_of_huge_clouds_fewer_are_read_ahead():
    huge = Cloud(0, None, np.broadcast_to(np.float32(0), (POINTS_AHEAD // 2 + 1, 3)))  # takes no memory itself
    read_so_far = 0

    def chunks():
        nonlocal read_so_far
        for number in range(20):
            read_so_far += 1
            yield Chunk("0" * 64, number, [huge], 0.0)

    def work(chunk):
        return Part(chunk.sha256, chunk.name, 0.0, 0, 0, b"")

    for taken, _ in enumerate(run_ahead(ThreadPoolExecutor(1), work, chunks(), 10), 1):
        assert read_so_far - taken <= 1


def test_chunks_hold_few_points(recordings, monkeypatch):
    monkeypatch.setattr(reading, "CHUNK_POINTS", 3 * POINTS)
    source = Source(recordings[0], "0" * 64, 1)
    *chunks, ending = read(source, Method(), frozenset())
    assert [len(chunk.clouds) for chunk in chunks] == [3] * 13 + [1]
    assert ending == Ending("0" * 64, 14, 40)
    done = {chunk.name for chunk in chunks[:-1]}
    (last,) = [item for item in read(source, Method(), done) if isinstance(item, Chunk)]
    assert last.name == chunks[-1].name


def test_workers_are_forked_from_what_their_parent_loaded():
    subprocess.run([sys.executable, "-c", FORKED], check=True)


def test_a_worker_that_dies_ends_the_run_in_one_sentence():
    ran = subprocess.run([sys.executable, "-c", DYING], check=False, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith(
        "expected every worker to live, but one died, for want of memory perhaps: run the"
    )
