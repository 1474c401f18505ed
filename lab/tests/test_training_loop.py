"""Training resumes where it stopped, and an exported network is proven equal to the trained one."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

import torch

from shipshape_lab.training import export, loop


def data(seed=1):
    def draw(i, rng):
        x = rng.normal(size=4).astype(np.float32)
        return {"x": x, "y": np.float32(x.sum() * (1 + i % 2))}

    return loop.Drawn(np.arange(128), draw, seed)


def loss_of(net, batch):
    return (net(batch["x"]).float()[:, 0] - batch["y"]).square().mean()


def fresh_net():
    torch.manual_seed(0)
    return torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.ReLU(), torch.nn.Linear(8, 1))


class Stopped(Exception):
    """Stands for a kill between two epochs."""


def test_a_run_that_was_stopped_ends_as_one_that_was_not(tmp_path, monkeypatch):
    schedule = loop.Schedule(epochs=3, batch=32)
    whole = loop.train(fresh_net(), data(), loss_of, schedule, tmp_path / "whole.pt")
    keep = loop._Run.keep

    def keep_and_stop(run, checkpoint, epoch):
        keep(run, checkpoint, epoch)
        raise Stopped

    monkeypatch.setattr(loop._Run, "keep", keep_and_stop)
    with pytest.raises(Stopped):
        loop.train(fresh_net(), data(), loss_of, schedule, tmp_path / "cut.pt")
    monkeypatch.setattr(loop._Run, "keep", keep)
    resumed = loop.train(fresh_net(), data(), loss_of, schedule, tmp_path / "cut.pt")
    for wanted, found in zip(whole.parameters(), resumed.parameters(), strict=True):
        torch.testing.assert_close(found, wanted)


def test_a_checkpoint_of_another_schedule_is_refused(tmp_path):
    loop.train(fresh_net(), data(), loss_of, loop.Schedule(epochs=1, batch=32), tmp_path / "net.pt")
    with pytest.raises(ValueError, match="expected a checkpoint of 8 steps in all, got one of 4"):
        loop.train(fresh_net(), data(), loss_of, loop.Schedule(epochs=2, batch=32), tmp_path / "net.pt")


def test_training_lowers_the_loss(tmp_path):
    net = loop.train(fresh_net(), data(), loss_of, loop.Schedule(20, batch=32, rate=0.02), tmp_path / "net.pt")
    unseen = data(seed=9)
    batch = torch.utils.data.default_collate([unseen[i] for i in range(len(unseen))])
    assert loss_of(net, batch) < 0.5 * loss_of(fresh_net(), batch)


def test_onnx_equals_torch_with_any_batch(tmp_path):
    path = tmp_path / "net.onnx"
    export.export(fresh_net(), {"x": torch.rand(1, 4)}, ["y"], path)
    assert export.prove_equal(fresh_net().eval(), {"x": torch.rand(1, 4)}, path) < export.TOLERANCE


def test_another_network_is_not_taken_for_the_exported_one(tmp_path):
    path = tmp_path / "net.onnx"
    export.export(fresh_net(), {"x": torch.rand(1, 4)}, ["y"], path)
    other = torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.ReLU(), torch.nn.Linear(8, 1))
    with pytest.raises(ValueError, match="expected ONNX to equal torch"):
        export.prove_equal(other, {"x": torch.rand(1, 4)}, path)
