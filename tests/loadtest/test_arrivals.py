"""Schedules: sorted, inside their duration, of the rate asked for, and the same for the same seed."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipshape.errors import FileError
from shipshape.loadtest.arrivals import Arrivals, Recording, bursts, constant, poisson
from shipshape.loadtest.recording import read_recording

RATES = st.floats(0.5, 2000)
SECONDS = st.floats(0.1, 60)
SEEDS = st.integers(0, 2**32)
KINDS = {
    "poisson": poisson,
    "constant": lambda rate, seconds, rng: constant(rate, seconds),
    "bursts": lambda rate, seconds, rng: bursts(rate, seconds, 7, rng),
}


@pytest.mark.parametrize("kind", KINDS)
@given(rate=RATES, seconds=SECONDS, seed=SEEDS)
def test_times_are_sorted_inside_the_duration_and_repeatable(kind, rate, seconds, seed):
    times = KINDS[kind](rate, seconds, np.random.default_rng(seed))
    assert (np.diff(times) >= 0).all()
    assert ((times >= 0) & (times < seconds + 1e-9)).all()
    assert (times == KINDS[kind](rate, seconds, np.random.default_rng(seed))).all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_rate_is_the_one_asked_for(kind):
    times = KINDS[kind](50.0, 2000.0, np.random.default_rng(1))
    assert len(times) == pytest.approx(100_000, rel=0.03)


def test_poisson_gaps_vary_as_those_of_independent_callers():
    gaps = np.diff(poisson(100.0, 1000.0, np.random.default_rng(2)))
    assert gaps.mean() == pytest.approx(0.01, rel=0.02)
    assert gaps.std() == pytest.approx(gaps.mean(), rel=0.02)  # of an exponential distribution


def test_constant_gaps_are_equal():
    assert np.diff(constant(20.0, 1.0)) == pytest.approx(np.full(19, 0.05))


def test_bursts_come_together():
    times = bursts(100.0, 10.0, 5, np.random.default_rng(3))
    assert (np.unique(times, return_counts=True)[1] == 5).all()


def recording(tmp_path, text):
    path = tmp_path / "harbour.csv"
    path.write_text(text)
    return read_recording(path)


def test_a_recording_is_played_as_it_was(tmp_path):
    found = recording(tmp_path, "seconds,contacts\n100.0,1\n100.5,0\n101.0,3\n")
    assert found.period_s == 1.5
    played = found.played(None, 3.0)
    assert played.seconds.tolist() == [0.0, 1.0, 1.5, 2.5]
    assert played.contacts.tolist() == [1, 3, 1, 3]


@given(rate=RATES, seconds=st.floats(5, 60))
def test_a_recording_can_be_played_at_another_rate(rate, seconds):
    known = Recording(Arrivals(np.array([0.0, 0.2, 0.9]), np.array([1, 4, 2])), 1.0)
    played = known.played(rate, seconds)
    assert (np.diff(played.seconds) >= 0).all()
    assert abs(played.contacts.sum() - rate * seconds) <= 7  # at most one round is cut short


@pytest.mark.parametrize(
    "text",
    [
        "",
        "time,count\n0,1\n1,1\n",
        "seconds,contacts\n0,1\n",
        "seconds,contacts\n1,1\n0,1\n",
        "seconds,contacts\n0,0\n1,0\n",
        "seconds,contacts\n0,1\nnan,1\n",
        "seconds,contacts\n0,1\n1,-1\n",
        "seconds,contacts\n0,1\n1,1.5\n",
        "seconds,contacts\n0,1\n1,1,1\n",
        "seconds,contacts\n0,1\n0,1\n",
    ],
)
def test_a_file_that_is_no_recording_is_refused_in_one_sentence(tmp_path, text):
    with pytest.raises(FileError, match=r"^expected .*harbour\.csv"):
        recording(tmp_path, text)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(FileError, match="expected to read"):
        read_recording(tmp_path / "none.csv")


ROOT = Path(__file__).parents[2]
CONVERT = ROOT / "benchmarks/autoferry_arrivals.py"
AUTOFERRY = ROOT.parent / "shared/data/lidar/autoferry"


def converted(detections, folder):
    runpy.run_path(str(CONVERT))["convert"](detections, folder / "harbour.csv")
    return read_recording(folder / "harbour.csv")


def test_detections_of_the_lidar_alone_are_converted(tmp_path):
    measured = [
        (1, 2.0, [[1.0, 2.0, 7.0], [3.0, 4.0, 8.0]]),
        (3, 1.2, [0.1, 0.2, 0.3]),
        (1, 1.0, []),
        (1, 1.5, [5.0, 6.0]),
    ]
    detections = [{"sensorID": sensor, "time": time, "measurement": found} for sensor, time, found in measured]
    (tmp_path / "detections.json").write_text(json.dumps(detections))
    found = converted(tmp_path / "detections.json", tmp_path)
    assert found.arrivals.seconds.tolist() == [0.5, 1.0]
    assert found.arrivals.contacts.tolist() == [1, 3]
    assert found.period_s == 1.5


@pytest.mark.skipif(
    not AUTOFERRY.is_dir(), reason="the recordings beside the checkout (../shared/data) are absent"
)
@pytest.mark.parametrize("scenario", [2, 13])
def test_real_harbour_contacts_convert_and_play(tmp_path, scenario):
    detections = AUTOFERRY / f"scenario{scenario}_detections.json"
    found = converted(detections, tmp_path)
    scans = [entry for entry in json.loads(detections.read_text()) if entry["sensorID"] == 1]
    assert found.period_s == pytest.approx(len(scans) * 0.5, rel=0.02)  # two scans a second
    numbers = sum(np.size(scan["measurement"]) for scan in scans)
    assert found.arrivals.contacts.sum() * 2 == numbers  # north and east of each contact
