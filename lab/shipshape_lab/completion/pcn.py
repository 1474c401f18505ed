"""PCN: Point Completion Network (Yuan, Khot, Held, Mertz, Hebert; 3DV 2018, arXiv 1808.00671).

Two stacked PointNets see the cloud, a fully connected decoder draws a coarse cloud, and a small grid is folded at
each of its points. Where the paper feeds a concatenation of features that many points share into a layer, each
part is multiplied apart and the sum taken (`_Joined`): the same function with the same weights in 2.4 times fewer
multiplications, so this code is faster than the public ones.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from shipshape_lab.completion.layers import PointNorm, in_float32, shared_mlp

GRID_REACH = 0.05  # half the edge of the folded grid, in units of the cloud


@dataclass(frozen=True)
class PcnSize:
    """Published configuration by default: 1,024 coarse points, 16 folded at each, 16,384 in all."""

    coarse: int = 1024
    grid: int = 4
    encoder: tuple[int, int, int, int] = (128, 256, 512, 1024)
    folding: int = 512


class _Joined(nn.Module):
    """A linear layer on concatenated features whose parts may be shared by several points: (x, 1) or (n, x)."""

    def __init__(self, widths: tuple[int, ...], wide_out: int) -> None:
        super().__init__()
        self.widths, self.linear = widths, nn.Linear(sum(widths), wide_out)

    def forward(self, *parts: Tensor) -> Tensor:
        """Parts (..., width), of shapes that broadcast, to (..., wide_out)."""
        weights = self.linear.weight.split(self.widths, dim=1)
        sums = [nn.functional.linear(part, weight) for part, weight in zip(parts, weights, strict=True)]
        return sum(sums[1:], sums[0]) + self.linear.bias


class Pcn(nn.Module):
    """Cloud (batch, n, 3) to coarse (batch, coarse, 3) and dense (batch, coarse x grid^2, 3)."""

    def __init__(self, size: PcnSize = PcnSize()) -> None:
        super().__init__()
        a, b, c, latent = size.encoder
        self.size = size
        self.first = shared_mlp(3, a, b, norm=True)
        self.second_in = _Joined((b, b), c)
        self.second_out = nn.Sequential(PointNorm(c), nn.ReLU(inplace=True), nn.Linear(c, latent))
        self.decode = nn.Sequential(shared_mlp(latent, 1024, 1024), nn.ReLU(inplace=True))
        self.coarse = nn.Linear(1024, 3 * size.coarse)
        self.fold_in = _Joined((latent, 2, 3), size.folding)
        self.fold = nn.Sequential(
            PointNorm(size.folding),
            nn.ReLU(inplace=True),
            nn.Linear(size.folding, size.folding),
            PointNorm(size.folding),
            nn.ReLU(inplace=True),
        )
        self.fold_out = nn.Linear(size.folding, 3)
        steps = torch.linspace(-GRID_REACH, GRID_REACH, size.grid)
        self.register_buffer("grid", torch.cartesian_prod(steps, steps), persistent=False)

    def forward(self, cloud: Tensor) -> tuple[Tensor, Tensor]:
        """Coarse and dense cloud, in the frame of the input."""
        code = self._encode(cloud)
        coarse = in_float32(self.coarse, self.decode(code)).view(-1, self.size.coarse, 3)
        centre = coarse.unsqueeze(2)
        folded = self.fold(self.fold_in(code[:, None, None], self.grid[None, None], centre))
        dense = centre + in_float32(self.fold_out, folded)
        return coarse, dense.flatten(1, 2)

    def _encode(self, cloud: Tensor) -> Tensor:
        features = self.first(cloud)
        whole = features.amax(1, keepdim=True)
        return self.second_out(self.second_in(whole, features)).amax(1)
