"""Both completion networks run in ONNX Runtime as in torch, and their times are told in their favour."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

import torch

from shipshape.onnx_model import OnnxModel
from shipshape_lab.completion.pcn import Pcn, PcnSize
from shipshape_lab.completion.snowflakenet import SnowflakeNet, SnowflakeSize
from shipshape_lab.experiments import restore_ms
from shipshape_lab.experiments.pages import restore_ms as page
from shipshape_lab.experiments.restore_ms_figure import draw
from shipshape_lab.simulator.clusters import ClusterSet

TINY = {
    "pcn": Pcn(PcnSize(16, 2, (8, 16, 16, 32), 16)),
    "snowflakenet": SnowflakeNet(SnowflakeSize(32, 16, 32, (1, 2), (16, 8), 4, 8)),
}


def times():
    """Elapsed and processor milliseconds, three turns each."""
    elapsed = {
        "best": 2.0,
        "pcn_onnx": 60.0,
        "pcn_torch": 80.0,
        "snowflakenet_onnx": 90.0,
        "snowflakenet_torch": 70.0,
    }
    return {name: np.array([[ms, ms - 1], [ms + 1, ms], [ms + 30, ms + 1]]) for name, ms in elapsed.items()}


@pytest.mark.parametrize("model", list(TINY))
def test_onnx_gives_what_torch_gives(model, tmp_path, monkeypatch):
    monkeypatch.setattr(restore_ms, "POINTS", 40)
    cloud = torch.rand(1, 40, 3)
    monkeypatch.setattr(restore_ms, "cloud_of", lambda run: cloud.numpy())
    net = TINY[model].eval()
    in_onnx = restore_ms.in_onnx(net, tmp_path, model)(None)[-1]
    in_torch = restore_ms.in_torch(net, "cpu")(None)
    np.testing.assert_allclose(in_onnx, in_torch, atol=1e-5)
    assert OnnxModel(tmp_path / f"{model}.onnx").signature.inputs[0].shape == (-1, 40, 3)


def test_a_network_is_as_fast_as_the_faster_of_its_forms():
    found = restore_ms.numbers_of(times())
    assert found["P.restore_ms.best"] == 2.0
    assert (found["P.restore_ms.pcn"], found["P.restore_ms.snowflakenet"]) == (60.0, 70.0)
    assert found["P.restore_elapsed_ms.pcn"] == 61.0
    assert found["P.restore_times_faster.pcn"] == 30.0


def test_elapsed_time_counts_on_a_gpu():
    found = restore_ms.numbers_of({**times(), "pcn.gpu": np.array([[5.0, 1.0]])})
    assert found["P.restore_ms.pcn.gpu"] == 5.0


def test_every_contact_has_exactly_as_many_points(monkeypatch):
    sizes = np.array([20, 50, 31, 30], np.int32)
    rest = ("label", "classes", "heading", "range_m", "bearing", "aspect_deg", "sensor_height", "hull_seed")
    rest = dict.fromkeys((*rest, "T_level_vessel", "lidar", "seed"), np.zeros(4))
    points = np.random.default_rng(0).random((int(sizes.sum()), 3)).astype(np.float32)
    clusters = ClusterSet(points=points, n=sizes, **rest)
    monkeypatch.setattr(restore_ms, "POINTS", 30)
    contacts = restore_ms.contacts_of(clusters)
    assert {len(contact.points_level) for contact in contacts} == {30}
    monkeypatch.setattr(restore_ms, "POINTS", 51)
    with pytest.raises(ValueError, match="expected clusters of at least 51 points, got at most 50"):
        restore_ms.contacts_of(clusters)


def test_the_page_tells_what_was_measured(tmp_path):
    found = restore_ms.numbers_of(times())
    text = page.section(found, {"turns": 3, "machine": "a processor, 2 cores"})
    assert "| PCN, ONNX Runtime | 60.00 | 61.00 |" in text
    assert "30 times as fast as PCN and 35 times as fast as SnowflakeNet" in text
    assert "No GPU was at hand" in text
    assert draw(found, tmp_path).stat().st_size > 5_000
