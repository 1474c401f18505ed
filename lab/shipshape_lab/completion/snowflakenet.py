"""SnowflakeNet (Xiang, Wen, Liu, Cao, Wan, Zheng, Han; ICCV 2021, arXiv 2108.04444).

Set abstraction and local attention see the cloud, a seed generator draws a first rough cloud, and each snowflake
point deconvolution (Deconvolution) splits every point into children and moves them; its attention hands what one
step learnt to the next. Neighbours and farthest points are plain torch in place of the public code's CUDA kernels.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from shipshape_lab.completion.layers import (
    ResidualMlp,
    farthest,
    in_float32,
    neighbours,
    shared_mlp,
    take,
)


@dataclass(frozen=True)
class SnowflakeSize:
    """Published configuration by default: 256 seeds, 512 starting points, 16,384 in all."""

    code: int = 512  # channels of the whole cloud's code
    seeds: int = 256
    start: int = 512
    factors: tuple[int, ...] = (1, 4, 8)  # children of a point in each step
    centres: tuple[int, int] = (512, 128)  # points that the two set abstractions keep
    neighbours: int = 16
    attention: int = 64  # channels, four times as many inside


class _Attention(nn.Module):
    """Attention of each point over its neighbours: subtraction, one weight a channel, position encoded."""

    def __init__(self, wide: int, size: SnowflakeSize) -> None:
        super().__init__()
        inner = size.attention
        self.count = size.neighbours
        self.query, self.key, self.value = (nn.Linear(wide, inner) for _ in range(3))
        self.place = shared_mlp(3, 64, inner, norm=True)
        self.weigh = shared_mlp(inner, 4 * inner, inner, norm=True)
        self.out = nn.Linear(inner, wide)

    def forward(self, points: Tensor, query: Tensor, key: Tensor, value: Tensor) -> Tensor:
        """Points (batch, n, 3) and their features (batch, n, wide) to (batch, n, wide)."""
        index = neighbours(points, points, self.count)
        place = self.place(points.unsqueeze(2) - take(points, index))
        weights = self.weigh(self.query(query).unsqueeze(2) - take(self.key(key), index) + place).softmax(2)
        return self.out((weights * (self.value(value).unsqueeze(2) + place)).sum(2))


class _SelfAttention(nn.Module):
    """Attention of the encoder: features brought down to its width first, and added to at the end."""

    def __init__(self, wide: int, size: SnowflakeSize) -> None:
        super().__init__()
        self.narrow, self.attend = nn.Linear(wide, size.attention), _Attention(size.attention, size)
        self.attend.out = nn.Linear(size.attention, wide)

    def forward(self, points: Tensor, features: Tensor) -> Tensor:
        """Points (batch, n, 3) and features (batch, n, wide) to features of the same shape."""
        narrow = self.narrow(features)
        return features + self.attend(points, narrow, narrow, narrow)


class _SetAbstraction(nn.Module):
    """Farthest points as centres, and for each the largest feature among its neighbours."""

    def __init__(self, wide_in: int, hidden: int, wide_out: int, centres: int, count: int) -> None:
        super().__init__()
        self.mlp, self.centres, self.count = shared_mlp(3 + wide_in, hidden, wide_out), centres, count

    def forward(self, points: Tensor, features: Tensor) -> tuple[Tensor, Tensor]:
        """Points (batch, n, 3), features (batch, n, wide_in) to the same of fewer points and wide_out."""
        centres = take(points, farthest(points, self.centres))
        index = neighbours(centres, points, self.count)
        local = torch.cat([take(points, index) - centres.unsqueeze(2), take(features, index)], -1)
        return centres, self.mlp(local).amax(2)


class _Encoder(nn.Module):
    """Cloud to one code, (batch, 1, code)."""

    def __init__(self, size: SnowflakeSize) -> None:
        super().__init__()
        self.near = _SetAbstraction(3, 64, 128, size.centres[0], size.neighbours)
        self.near_attention = _SelfAttention(128, size)
        self.wide = _SetAbstraction(128, 128, 256, size.centres[1], size.neighbours)
        self.wide_attention = _SelfAttention(256, size)
        self.whole = shared_mlp(3 + 256, 512, size.code)

    def forward(self, cloud: Tensor) -> Tensor:
        """Cloud (batch, n, 3) to its code."""
        points, features = self.near(cloud, cloud)
        points, features = self.wide(points, self.near_attention(points, features))
        features = self.wide_attention(points, features)
        return self.whole(torch.cat([points, features], -1)).amax(1, keepdim=True)


class _SeedGenerator(nn.Module):
    """The code to a rough cloud (batch, seeds, 3): a point-wise splitting, then shared residual layers."""

    def __init__(self, size: SnowflakeSize) -> None:
        super().__init__()
        self.split = nn.ConvTranspose1d(size.code, 128, size.seeds)
        self.first = ResidualMlp(size.code + 128, 128, 128)
        self.second = ResidualMlp(128, 64, 128)
        self.third = ResidualMlp(size.code + 128, 128, 128)
        self.place = shared_mlp(128, 64, 3)

    def forward(self, code: Tensor) -> Tensor:
        """Code (batch, 1, code) to seeds (batch, seeds, 3)."""
        features = self.split(code.transpose(1, 2)).transpose(1, 2)
        codes = code.expand(-1, features.shape[1], -1)
        features = self.second(self.first(torch.cat([features, codes], -1)))
        return in_float32(self.place, self.third(torch.cat([features, codes], -1)))


class _Deconvolution(nn.Module):
    """Snowflake point deconvolution: every point to `factor` children, each moved by at most 1."""

    def __init__(self, factor: int, size: SnowflakeSize) -> None:
        super().__init__()
        self.factor = factor
        self.point = shared_mlp(3, 64, 128)
        self.query = shared_mlp(2 * 128 + size.code, 256, 128)
        self.value, self.attend = ResidualMlp(256, 128, 128), _Attention(128, size)
        self.split = nn.Sequential(shared_mlp(128, 64, 32), nn.Linear(32, 128 * factor, bias=False))
        self.learnt = ResidualMlp(256, 128, 128)
        self.move = shared_mlp(128, 64, 3)

    def forward(self, points: Tensor, code: Tensor, key: Tensor | None) -> tuple[Tensor, Tensor]:
        """Points (batch, n, 3), code, what the last step learnt, to children and what this step learnt."""
        own = self.point(points)
        shared = torch.cat([own.amax(1, keepdim=True), code], -1).expand(-1, own.shape[1], -1)
        query = self.query(torch.cat([own, shared], -1))
        key = query if key is None else key
        value = self.value(torch.cat([key, query], -1))
        context = value + self.attend(points, query, key, value)
        batch, n, wide = context.shape
        split = self.split(context).view(batch, n * self.factor, wide)
        learnt = self.learnt(torch.cat([split, context.repeat_interleave(self.factor, 1)], -1))
        step = torch.tanh(in_float32(self.move, torch.relu(learnt)))
        return points.repeat_interleave(self.factor, 1) + step, learnt


class SnowflakeNet(nn.Module):
    """Cloud (batch, n, 3) to clouds of ever more points: the seeds, then one a deconvolution."""

    def __init__(self, size: SnowflakeSize = SnowflakeSize()) -> None:
        super().__init__()
        self.start = size.start
        self.encode, self.seeds = _Encoder(size), _SeedGenerator(size)
        self.steps = nn.ModuleList(_Deconvolution(factor, size) for factor in size.factors)

    def forward(self, cloud: Tensor) -> tuple[Tensor, ...]:
        """Seeds, then the cloud after each step, in the frame of the input."""
        code = self.encode(cloud)
        clouds = [self.seeds(code)]
        both = torch.cat([clouds[0], cloud], 1)
        points, learnt = take(both, farthest(both, self.start)), None
        for step in self.steps:
            points, learnt = step(points, code, learnt)
            clouds.append(points)
        return tuple(clouds)
