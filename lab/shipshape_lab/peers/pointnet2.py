"""PointNet++ for classification with single-scale grouping (Qi et al., NeurIPS 2017).

Two set abstractions, each farthest point sampling, ball query and a small PointNet, then one PointNet over all
that is left. Widths as published (64, 64, 128; 128, 128, 256; 256, 512, 1024). Changed for clusters of about a
hundred points, and for one CPU core:

- centres 128 and 32 instead of 512 and 128, neighbours 16 instead of 32 and 64;
- balls of 2 m and 6 m, because a vessel's size is not scaled away;
- offsets in a ball are divided by its radius, and every point knows its own coordinates too (both as in PointNeXt,
  Qian et al., NeurIPS 2022): height above the water means something;
- a cluster with fewer points than centres gets no copies: each of its points is a centre.

Added are the three features of the whole cluster, before the last layers.
"""

import torch
from torch import Tensor, nn

from shipshape_lab.peers.clouds import FEATURES, UNIT, Packed, exists, head, shared_mlp


class PointNet2(nn.Module):
    """Points of a cluster -> class logits."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.near = SetAbstraction(centres=128, radius=2.0, neighbours=16, widths=(3, 64, 64, 128))
        self.far = SetAbstraction(centres=32, radius=6.0, neighbours=16, widths=(128, 128, 128, 256))
        self.rest = shared_mlp(3 + 256, 256, 512, 1024)
        self.head = head(1024 + FEATURES, classes)

    def forward(self, points: Tensor, count: Tensor, features: Tensor) -> Tensor:
        """(b, n, 3) metres, (b,) and (b, 3), see `clouds.network_inputs`, to (b, classes)."""
        seen = points / UNIT
        points, seen, count = self.near(points, seen, count)
        points, seen, count = self.far(points, seen, count)
        left = Packed.of(torch.cat([points / UNIT, seen], dim=2), count)
        whole = Packed(self.rest(left.rows), left.sizes).largest()
        return self.head(torch.cat([whole, features], dim=1))


class SetAbstraction(nn.Module):
    """Fewer points, each of which knows its surroundings.

    Args:
        centres: most points that are kept.
        radius: of the ball around each, metres.
        neighbours: points looked at in each ball.
        widths: channels of a point going in, then of each layer.
    """

    def __init__(self, *, centres: int, radius: float, neighbours: int, widths: tuple[int, ...]) -> None:
        super().__init__()
        self.centres, self.radius, self.neighbours = centres, radius, neighbours
        self.each = shared_mlp(3 + widths[0], *widths[1:])

    def forward(self, points: Tensor, seen: Tensor, count: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Points (b, n, 3), what is known of them (b, n, channels), how many are real (b,); out the same."""
        chosen = farthest_points(points, count, self.centres)
        centres = take(points, chosen)
        kept = count.clamp(max=self.centres)
        members = in_ball(points, count, centres, self.radius, self.neighbours)
        real = exists(self.centres, kept)
        cloud = torch.arange(len(points), device=points.device)[:, None].expand_as(real)[real][:, None]
        members = members[real]
        offsets = (points[cloud, members] - centres[real][:, None]) / self.radius
        grouped = torch.cat([offsets, seen[cloud, members]], dim=2)
        largest = self.each(grouped.flatten(0, 1)).unflatten(0, grouped.shape[:2]).max(dim=1).values
        known = largest.new_zeros((*real.shape, largest.shape[1]))
        known[real] = largest
        return centres, known, kept


def take(points: Tensor, chosen: Tensor) -> Tensor:
    """Of points (b, n, 3) those with the numbers (b, m), as (b, m, 3)."""
    return points.gather(1, chosen[:, :, None].expand(-1, -1, 3))


@torch.no_grad()
def farthest_points(points: Tensor, count: Tensor, samples: int) -> Tensor:
    """Farthest point sampling: numbers (b, samples) of points, each farthest from all that were taken before it.

    The first is point 0: the order is random. Once the `count` real points are used up they come again.
    """
    distance = torch.where(exists(points.shape[1], count), torch.inf, -1.0)
    latest = torch.zeros(len(points), dtype=torch.long, device=points.device)
    chosen = [latest]
    for _ in range(samples - 1):
        reach = (points - take(points, latest[:, None])).square().sum(dim=2)
        distance = torch.minimum(distance, reach)
        latest = distance.argmax(dim=1)
        chosen.append(latest)
    return torch.stack(chosen, dim=1)


@torch.no_grad()
def in_ball(points: Tensor, count: Tensor, centres: Tensor, radius: float, most: int) -> Tensor:
    """Ball query: numbers (b, m, most) of the first points within `radius` of each centre (b, m, 3).

    Where the ball holds fewer, its first point stands for the missing ones, as in the original. Centres are points
    themselves, so that no ball is empty.
    """
    n = points.shape[1]
    apart = torch.cdist(centres, points, compute_mode="donot_use_mm_for_euclid_dist")
    inside = (apart <= radius) & exists(n, count)[:, None]
    numbers = torch.where(inside, torch.arange(n, device=points.device), n)
    first = numbers.topk(min(most, n), dim=2, largest=False, sorted=True).values
    return torch.where(first < n, first, first[:, :, :1])
