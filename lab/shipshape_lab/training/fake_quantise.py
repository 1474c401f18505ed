"""Quantisation-aware training: the last epoch sees the rounding that int8 brings, so that weights settle to it.

Batch norms are folded into their convolutions first, as the runtime does. What is exported afterwards is the plain
float32 network; `quantise` turns it into int8 with the ranges of the same training examples.
"""

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

LEVELS = 255  # of an unsigned byte; weights use -127 to 127
MOMENTUM = 0.01  # of the running range of activations


class RoundedConv(nn.Conv2d):
    """A convolution whose input and weights are rounded as int8 would, while it is in training mode.

    Inputs share one scale and zero point, weights have one scale for each output channel: the static QDQ scheme
    of ONNX Runtime. In evaluation mode it is an ordinary convolution.
    """

    def __init__(self, plain: nn.Conv2d) -> None:
        super().__init__(
            plain.in_channels, plain.out_channels, plain.kernel_size, plain.stride, plain.padding, bias=True
        )
        self.weight, self.bias = plain.weight, plain.bias
        self.register_buffer("low", torch.tensor(float("inf")))
        self.register_buffer("high", torch.tensor(float("-inf")))

    def forward(self, image: Tensor) -> Tensor:
        """(n, channels, rows, columns) to the same with as many channels as the convolution gives."""
        if not self.training:
            return super().forward(image)
        image = image.float()
        self._widen(image.detach())
        return self._conv_forward(self._rounded(image), self._rounded_weight(), self.bias)

    def _widen(self, image: Tensor) -> None:
        low, high = image.amin().clamp(max=0.0), image.amax().clamp(min=0.0)
        started = bool(torch.isfinite(self.low))
        self.low.copy_(torch.lerp(self.low, low, MOMENTUM) if started else low)
        self.high.copy_(torch.lerp(self.high, high, MOMENTUM) if started else high)

    def _rounded(self, image: Tensor) -> Tensor:
        scale = ((self.high - self.low) / LEVELS).clamp(min=1e-8)
        zero = (-self.low / scale).round().clamp(0, LEVELS).to(torch.int32)
        return torch.fake_quantize_per_tensor_affine(image, scale, zero, 0, LEVELS)

    def _rounded_weight(self) -> Tensor:
        scale = (self.weight.detach().abs().amax(dim=(1, 2, 3)) / 127).clamp(min=1e-8)
        zero = torch.zeros(len(scale), dtype=torch.int32, device=scale.device)
        return torch.fake_quantize_per_channel_affine(self.weight, scale, zero, 0, -127, 127)


def rounded(net: nn.Module) -> nn.Module:
    """The trained network with batch norms folded and every convolution a `RoundedConv`, changed in place."""
    net.eval()
    for block in [module for module in net.modules() if isinstance(module, nn.Sequential)]:
        for i, norm in enumerate(block):
            if isinstance(norm, nn.BatchNorm2d):
                block[i - 1], block[i] = fuse_conv_bn_eval(block[i - 1], norm), nn.Identity()
    for parent in list(net.modules()):
        for name, child in list(parent.named_children()):
            if isinstance(child, nn.Conv2d):
                setattr(parent, name, RoundedConv(child))
    return net
