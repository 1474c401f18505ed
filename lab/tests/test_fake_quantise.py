import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

import torch

from shipshape_lab.training.fake_quantise import RoundedConv, rounded
from shipshape_lab.training.nets import AlignedNet, InpaintingNet

INPUTS = {AlignedNet: (9, 3), InpaintingNet: (18, 3)}


def network(kind):
    torch.manual_seed(0)
    net = AlignedNet(6) if kind is AlignedNet else InpaintingNet(6, (0.0, 0.3, 0.6, 1.0))
    planes, features = INPUTS[kind]
    inputs = torch.rand(8, planes, 32, 64), torch.rand(8, features)
    net.train()
    for _ in range(20):  # so that the batch norms hold something to fold
        net(*inputs)
    return net.eval(), inputs


@pytest.mark.parametrize("kind", INPUTS)
def test_folding_changes_nothing_in_evaluation(kind):
    net, inputs = network(kind)
    before = net(*inputs)
    after = rounded(net).eval()(*inputs)
    for a, b in zip(before, after, strict=True):
        assert torch.allclose(a, b, atol=1e-4)
    assert not any(isinstance(module, torch.nn.BatchNorm2d) for module in net.modules())


def test_training_sees_rounded_values_and_still_learns():
    conv = RoundedConv(torch.nn.Conv2d(1, 1, 1))
    with torch.no_grad():
        conv.weight.fill_(0.5)
        conv.bias.fill_(0.0)
    image = torch.linspace(0.0, 1.0, 1000).view(1, 1, 1, -1)
    seen = conv.train()(image)
    assert len(torch.unique(seen)) <= 256
    assert torch.allclose(seen, 0.5 * image, atol=0.5 / 255)
    seen.sum().backward()
    assert conv.weight.grad.abs().sum() > 0
    assert len(torch.unique(conv.eval()(image))) == 1000


def test_the_range_of_activations_follows_what_passes():
    conv = RoundedConv(torch.nn.Conv2d(1, 1, 1)).train()
    conv(torch.full((1, 1, 2, 2), 4.0))
    assert (conv.low.item(), conv.high.item()) == (0.0, 4.0)
    conv(torch.full((1, 1, 2, 2), 5.0))
    assert conv.high.item() == pytest.approx(4.01)
