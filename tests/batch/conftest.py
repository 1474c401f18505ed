from pathlib import Path

import pytest

from batch.fakes import FakeEngine
from batch.written import write_inputs
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
