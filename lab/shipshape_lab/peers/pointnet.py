"""PointNet for classification (Qi et al., CVPR 2017): every point alone, then the largest of each channel.

Widths and batch normalisation as published. Left out are the two transforms (T-nets): the sight frame already
fixes what they would have to learn, up to the heading. Added are the three features of the whole cluster, before
the last layers.
"""

import torch
from torch import Tensor, nn

from shipshape_lab.peers.clouds import FEATURES, UNIT, Packed, head, shared_mlp


class PointNet(nn.Module):
    """Points of a cluster -> class logits."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.each = shared_mlp(3, 64, 64, 64, 128, 1024)
        self.head = head(1024 + FEATURES, classes)

    def forward(self, points: Tensor, count: Tensor, features: Tensor) -> Tensor:
        """(b, n, 3) metres, (b,) and (b, 3), see `clouds.network_inputs`, to (b, classes)."""
        cloud = Packed.of(points / UNIT, count)
        whole = Packed(self.each(cloud.rows), cloud.sizes).largest()
        return self.head(torch.cat([whole, features], dim=1))
