from pathlib import Path

import numpy as np
import pytest

from batch.fakes import FakeEngine
from batch.written import cloud, packed, write_mcap
from builders_recognition import side_of_hull
from shipshape.batch import command, reading


@pytest.fixture
def engine(monkeypatch) -> FakeEngine:
    """Stands in for the pipeline, and cuts chunks so small that each run has many."""
    fake = FakeEngine(None)
    monkeypatch.setattr(command, "engine_of", lambda arguments, method: fake)
    monkeypatch.setattr(reading, "CHUNK_CLOUDS", 4)
    return fake


@pytest.fixture
def inputs(tmp_path: Path) -> Path:
    """A folder of one recording of 15 messages, one file of 10 clusters and one damaged file."""
    return write_inputs(tmp_path / "inputs")


def write_inputs(folder: Path, messages: int = 15, clusters: int = 10) -> Path:
    folder.mkdir()
    rng = np.random.default_rng(1)

    def hull() -> np.ndarray:
        place = (float(rng.uniform(30, 90)), float(rng.uniform(-30, 30)), -3.0)
        return side_of_hull(float(rng.uniform(-3, 3)), place)

    write_mcap(folder / "b.mcap", [cloud(packed(hull())) for _ in range(messages)], chunk=2000)
    hulls = [hull() for _ in range(clusters)]
    hulls[3] = hulls[3][:5]  # too few points
    np.savez(folder / "a.npz", points=np.concatenate(hulls), n=[len(points) for points in hulls])
    (folder / "c.bag").write_bytes(b"no bag")
    return folder
