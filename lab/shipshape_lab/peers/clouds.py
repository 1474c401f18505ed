"""What the point networks see of a contact: its points along the line of sight, at their true scale.

The frame is the service's own sight frame: gravity-aligned, x away from the sensor. Nothing is scaled to a unit
sphere, because size is the strongest cue there is. Beside the points the networks are told what they cannot see in
them: how far away the cluster is, how many points it had, and whether its height above the water is known.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from shipshape import sight
from shipshape.types import Contact

MOST_POINTS = 512  # three quarters of the validation clusters have fewer; of the others that many are drawn
FEATURES = 3
UNIT = 10.0  # m; coordinates in it are of the order of one


def network_inputs(contact: Contact, rng: np.random.Generator) -> dict:
    """Points (MOST_POINTS, 3) in the sight frame, metres, zero after the first `count`; features (3,).

    Args:
        contact: the cluster.
        rng: chance, which draws and orders the points.

    Returns:
        points, count, and features (log range, log number of points, whether the waterline is known).
    """
    frame = sight.sight_frame(contact)
    n = len(contact.points_level)
    drawn = rng.permutation(n)[:MOST_POINTS]
    points = np.zeros((MOST_POINTS, 3), np.float32)
    points[: len(drawn)] = sight.to_sight(contact.points_level[drawn], frame)
    features = [math.log(max(frame.range_m, 1.0)), math.log(n), float(frame.knows_water)]
    return {"points": points, "count": len(drawn), "features": np.array(features, np.float32)}


@dataclass(frozen=True)
class Packed:
    """Sets of different sizes, one behind the other, so that no set is filled up with copies.

    Attributes:
        rows: what there is of every element of every set, (sum of sizes, channels).
        sizes: elements of each set.
    """

    rows: Tensor
    sizes: list[int]

    @classmethod
    def of(cls, padded: Tensor, count: Tensor) -> "Packed":
        """The first `count` (b,) elements of each set of `padded` (b, n, channels)."""
        return cls(padded[exists(padded.shape[1], count)], count.tolist())

    def largest(self) -> Tensor:
        """The largest value of each channel in each set, (b, channels): no order of the elements in it."""
        return torch.stack([members.max(dim=0).values for members in self.rows.split(self.sizes)])


def exists(n: int, count: Tensor) -> Tensor:
    """Which of n places are filled where the first `count` (b,) are, (b, n) bool."""
    return torch.arange(n, device=count.device) < count[:, None]


def shared_mlp(*channels: int) -> nn.Sequential:
    """Fully connected layers with batch normalisation and ReLU, applied to every row alike."""
    layers: list[nn.Module] = []
    for width_in, width_out in itertools.pairwise(channels):
        layers += [nn.Linear(width_in, width_out, bias=False), nn.BatchNorm1d(width_out), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


def head(width: int, classes: int) -> nn.Sequential:
    """Both networks' last layers: what is known of the whole cluster (n, width) to class logits (n, classes)."""
    return nn.Sequential(shared_mlp(width, 512), nn.Dropout(0.3), shared_mlp(512, 256), nn.Linear(256, classes))
