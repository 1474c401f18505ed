from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is missing: make torch adds it")

import torch

from shipshape import raster
from shipshape_lab.fleet import start
from shipshape_lab.training import loop, train_aligned, train_inpainting, train_points
from shipshape_lab.training.nets import AlignedNet, InpaintingNet, PointsNet

ALIGNED = Path(__file__).parents[2] / "models/aligned.onnx"
EDGES = raster.aligned_frame(1.0).edges
MAKERS = {
    "aligned": (AlignedNet, train_aligned.write),
    "inpainting": (lambda classes: InpaintingNet(classes, EDGES), train_inpainting.write),
    "points": (PointsNet, train_points.write),
}


def inputs_of(name):
    if name == "points":
        members = torch.randint(128, (32, 32 * 16))
        return [
            torch.rand(32, 6, 128, 16),
            members,
            torch.rand(32, 3, 32, 16),
            torch.rand(32, 3, 32, 1),
            torch.rand(32, 3),
        ]
    return [torch.rand(32, {"aligned": 9, "inpainting": 18}[name], 32, 64), torch.rand(32, 3)]


@pytest.mark.parametrize("name", MAKERS)
def test_a_network_goes_on_where_an_exported_one_ended(tmp_path, name):
    make, write = MAKERS[name]
    torch.manual_seed(0)
    trained = make(6)
    inputs = inputs_of(name)
    trained.train()
    trained(*inputs)  # gives the batch norms something to remember
    write(trained, tmp_path)

    taken_up = make(4)
    start.take_up(taken_up, start.layers_of(tmp_path / f"{name}.onnx"), inputs)

    with torch.no_grad():
        wanted, found = trained.eval()(*inputs), taken_up.eval()(*inputs)
    for want, got in zip(wanted[:-1], found[:-1], strict=True):
        assert got.numpy() == pytest.approx(want.numpy(), abs=1e-4)
    assert found[-1].shape == (32, 4)  # the head of the classes is new


def test_another_kind_of_network_is_refused(tmp_path):
    train_aligned.write(AlignedNet(6), tmp_path)
    inputs = [torch.rand(4, 18, 32, 64), torch.rand(4, 3)]
    with pytest.raises(ValueError, match=r"expected a network with a layer down\.0\.0\.0 of shape"):
        start.take_up(InpaintingNet(6, EDGES), start.layers_of(tmp_path / "aligned.onnx"), inputs)


def test_int8_becomes_float_again():
    layers = start.layers_of(ALIGNED)
    convolutions, linear = layers[torch.nn.Conv2d], layers[torch.nn.Linear]
    assert [len(convolutions), len(linear)] == [7, 6]
    weight, bias = convolutions[1]
    assert weight.dtype == bias.dtype == np.float32
    assert 0.01 < np.abs(weight).max() < 5.0
    # Still the few values that int8 leaves a channel.
    assert len(np.unique(weight[0])) <= 255


def test_training_takes_the_start_up(tmp_path):
    net, data = PointsNet(6), loop.Drawn(np.arange(128), lambda i, rng: {}, 1)
    loop.keep_start(net, data, loop.Schedule(2, rate=start.RATE), tmp_path / "points.pt")
    run = loop._Run(PointsNet(6), 4, 2e-3)
    assert run.resume(tmp_path / "points.pt") == 0
    assert run.net.axis.weight.detach().cpu().numpy() == pytest.approx(net.axis.weight.detach().cpu().numpy())
    assert run.optimizer.param_groups[0]["max_lr"] == start.RATE
