from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is missing: make torch adds it")

import torch

from shipshape import raster
from shipshape_lab.fleet import start
from shipshape_lab.training import loop, train_aligned, train_inpainting
from shipshape_lab.training.nets import AlignedNet, InpaintingNet, SightNet

SIGHT = Path(__file__).parents[2] / "models/sight.onnx"
EDGES = raster.aligned_frame(1.0).edges
CASES = {
    "aligned": (AlignedNet, train_aligned.write, 9, 4),
    "inpainting": (lambda classes: InpaintingNet(classes, EDGES), train_inpainting.write, 18, 4),
}


@pytest.mark.parametrize("name", CASES)
def test_a_network_goes_on_where_an_exported_one_ended(tmp_path, name):
    make, write, planes, kept = CASES[name]
    torch.manual_seed(0)
    trained = make(6)
    inputs = [torch.rand(32, planes, 32, 64), torch.rand(32, 3)]
    trained.train()
    trained(*inputs)  # gives the batch norms something to remember
    write(trained, tmp_path)

    taken_up = make(4)
    start.take_up(taken_up, start.layers_of(tmp_path / f"{name}.onnx"), inputs)

    with torch.no_grad():
        wanted, found = trained.eval()(*inputs), taken_up.eval()(*inputs)
    for want, got in zip(wanted[:kept], found[:kept], strict=True):
        assert got.numpy() == pytest.approx(want.numpy(), abs=1e-4)
    assert found[-1].shape == (32, 4)  # the head of the classes is new


def test_another_kind_of_network_is_refused(tmp_path):
    train_aligned.write(AlignedNet(6), tmp_path)
    inputs = [torch.rand(4, 3, 64, 64), torch.rand(4, 4)]
    with pytest.raises(ValueError, match=r"expected a network with a layer encode\.image\.0\.0 of shape"):
        start.take_up(SightNet(), start.layers_of(tmp_path / "aligned.onnx"), inputs)


@pytest.mark.skipif(not SIGHT.exists(), reason="the default bundle is not trained")
def test_int8_becomes_float_again():
    layers = start.layers_of(SIGHT)
    convolutions, linear = layers[torch.nn.Conv2d], layers[torch.nn.Linear]
    assert [len(convolutions), len(linear)] == [7, 4]
    weight, bias = convolutions[1]
    assert weight.dtype == bias.dtype == np.float32
    assert 0.01 < np.abs(weight).max() < 5.0
    # Still the few values that int8 leaves a channel.
    assert len(np.unique(weight[0])) <= 255


def test_training_takes_the_start_up(tmp_path):
    net, data = SightNet(), loop.Drawn(np.arange(128), lambda i, rng: {}, 1)
    loop.keep_start(net, data, loop.Schedule(2, rate=start.RATE), tmp_path / "sight.pt")
    run = loop._Run(SightNet(), 4, 2e-3)
    assert run.resume(tmp_path / "sight.pt") == 0
    assert run.net.axis.weight.detach().cpu().numpy() == pytest.approx(net.axis.weight.detach().cpu().numpy())
    assert run.optimizer.param_groups[0]["max_lr"] == start.RATE
