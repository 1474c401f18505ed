import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from shipshape.batch import inputs as inputs_module
from shipshape.batch import progress
from shipshape.batch.inputs import Inputs
from shipshape.batch.progress import Watch, progress_of
from shipshape.batch.units import Ending, Part


@pytest.fixture
def inputs(tmp_path: Path) -> Inputs:
    """Two files of 128 + 12 x 10 bytes, a copy of the first, and one that is not there."""
    for name, value in (("a", 1), ("b", 2), ("copy", 1)):
        np.save(tmp_path / f"{name}.npy", np.full((10, 3), value, np.float32))
    return Inputs([tmp_path / f"{name}.npy" for name in ("a", "b", "copy", "gone")])


def part(sha256: str, share: float) -> Part:
    return Part(sha256, "", share, rows=5, refused=0, table=b"")


def test_the_bar_counts_bytes_of_inputs_and_ends_when_all_are_done(inputs):
    assert inputs.size == 3 * 248
    first, second = inputs.sources()
    watch = Watch(inputs)
    assert watch.done == 248  # the copy
    watch.add(part(first.sha256, 0.5))
    assert watch.done == 248 + 124
    watch.add(part(first.sha256, 0.25))  # of Ray, parts come in any order
    assert watch.done == 248 + 124
    watch.add(Ending(first.sha256, 2, 1))
    watch.add(part(second.sha256, 1.0))
    assert watch.done == inputs.size
    assert str(watch).startswith("15 contacts  ")


def test_nothing_is_drawn_where_nobody_looks_on(inputs, capsys):
    (first, *_) = inputs.sources()
    with progress_of(inputs) as tell:
        tell(part(first.sha256, 0.5))
    assert capsys.readouterr() == ("", "")


def test_a_terminal_sees_contacts_rate_and_time_left(inputs, monkeypatch):
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=120)
    monkeypatch.setattr(progress, "Console", lambda stderr: console)
    (first, *_) = inputs.sources()
    with progress_of(inputs) as tell:
        tell(part(first.sha256, 0.5))
    assert "5 contacts" in screen.getvalue()
    assert "%" in screen.getvalue()


def test_it_says_which_input_is_hashed(inputs, monkeypatch):
    watch, seen = Watch(inputs), []
    digest = inputs_module._digest

    def watched(path: Path) -> str:
        seen.append(str(watch))
        return digest(path)

    monkeypatch.setattr(inputs_module, "_digest", watched)
    names = [source.path.name for source in inputs.sources()]
    assert names == ["a.npy", "b.npy"]
    assert [line.rpartition("/")[2] for line in seen] == ["a.npy", "b.npy", "copy.npy"]
    assert all(line.startswith("0 contacts, hashing ") for line in seen)
    assert "hashing" not in str(watch)
