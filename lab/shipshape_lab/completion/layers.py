"""What both networks are made of: MLPs shared by all points, neighbours, farthest points, Chamfer distance.

Clouds are (batch, points, 3) and features (batch, points, channels): a 1 x 1 convolution is a linear layer then.
Distances are computed in float32, also where training runs in bfloat16.
"""

import itertools

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor, nn

_TINY = 1e-10  # keeps the slope of a root finite at 0


class PointNorm(nn.BatchNorm1d):
    """Batch normalisation over all axes but the last."""

    def forward(self, features: Tensor) -> Tensor:
        """Features (..., channels) to the same shape."""
        return super().forward(features.flatten(0, -2)).view(features.shape)


def shared_mlp(*widths: int, norm: bool = False) -> nn.Sequential:
    """Linear layers from the first width to the last, ReLU (and normalisation if `norm`) between them."""
    layers: list[nn.Module] = []
    for wide_in, wide_out in itertools.pairwise(widths[:-1]):
        layers += [nn.Linear(wide_in, wide_out), *([PointNorm(wide_out)] if norm else []), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers, nn.Linear(*widths[-2:]))


class ResidualMlp(nn.Module):
    """Two shared layers beside a linear shortcut."""

    def __init__(self, wide_in: int, hidden: int, wide_out: int) -> None:
        super().__init__()
        self.mlp, self.shortcut = shared_mlp(wide_in, hidden, wide_out), nn.Linear(wide_in, wide_out)

    def forward(self, features: Tensor) -> Tensor:
        """Features (..., wide_in) to (..., wide_out)."""
        return self.mlp(features) + self.shortcut(features)


def in_float32(layer: nn.Module, features: Tensor) -> Tensor:
    """The layer without bfloat16: a coordinate of 0.5 would be rounded to 0.002, more than what is measured."""
    with torch.autocast(features.device.type, enabled=False):
        return layer(features.float())


def take(values: Tensor, index: Tensor) -> Tensor:
    """Rows of (batch, n, channels) at indices (batch, ...): (batch, ..., channels)."""
    flat = index.flatten(1).unsqueeze(-1).expand(-1, -1, values.shape[-1])
    return values.gather(1, flat).view(*index.shape, values.shape[-1])


def distances(a: Tensor, b: Tensor) -> Tensor:
    """Euclidean distances (batch, n, m) between two clouds (batch, n, 3) and (batch, m, 3)."""
    with torch.autocast(a.device.type, enabled=False):
        return torch.cdist(a.float(), b.float(), compute_mode="donot_use_mm_for_euclid_dist")


@torch.no_grad()
def neighbours(of: Tensor, among: Tensor, count: int) -> Tensor:
    """Indices (batch, n, count) of the points of `among` nearest to each point of `of`, nearest first."""
    return distances(of, among).topk(count, dim=-1, largest=False).indices


@torch.no_grad()
def farthest(cloud: Tensor, count: int) -> Tensor:
    """Indices (batch, count) of points chosen one by one, each the farthest from those before; the first is 0."""
    return _farthest(cloud, count)


@torch.jit.script_if_tracing  # a loop in ONNX as well, where tracing alone would write every turn of it out
def _farthest(cloud: Tensor, count: int) -> Tensor:
    last = torch.zeros(cloud.shape[0], 1, dtype=torch.long, device=cloud.device)
    gap = (cloud - cloud[:, :1]).square().sum(-1)
    chosen = last
    for _ in range(1, count):
        last = gap.argmax(-1, keepdim=True)
        point = cloud.gather(1, last.unsqueeze(-1).expand(-1, -1, 3))
        gap = torch.minimum(gap, (cloud - point).square().sum(-1))
        chosen = torch.cat([chosen, last], 1)
    return chosen


def to_nearest(a: Tensor, b: Tensor) -> Tensor:
    """Mean distance of each point of `a` to its nearest point of `b`; has a gradient, the choice has none."""
    chosen = take(b, nearest(a, b)).float()
    return ((a.float() - chosen).square().sum(-1) + _TINY).sqrt().mean()


@torch.no_grad()
def nearest(of: Tensor, among: Tensor) -> Tensor:
    """Index (batch, n) of the point of `among` nearest to each point of `of`."""
    if of.is_cuda:
        return distances(of, among).argmin(-1)
    # A search tree is ten times as fast as the whole matrix on a CPU.
    pairs = zip(among.float().numpy(), of.float().numpy(), strict=True)
    found = [cKDTree(cloud, compact_nodes=False, balanced_tree=False).query(points)[1] for cloud, points in pairs]
    return torch.from_numpy(np.stack(found))


def chamfer_l1(a: Tensor, b: Tensor) -> Tensor:
    """CD-L1 of two clouds, mean of the batch, as `shipshape_lab.metrics` defines it; has a gradient."""
    return (to_nearest(a, b) + to_nearest(b, a)) / 2
