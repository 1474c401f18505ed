"""The network of the generative restorer: what was measured and a noisy vessel to the vessel expected behind it.

What was measured is encoded once; each step of the flow encodes the noisy state, adds the two level by level, and
decodes. The class is read off the measured part alone: the state in training holds the truth and would tell it.
"""

import torch
from torch import Tensor, nn

from shipshape_lab.training.nets import LayerNet, conv

PLANES, FEATURES = 18, 3  # of what was measured, as the stage `inpainting` makes them
STATE = 15  # channels of a state: occupancy, top and bottom of three layers, and the offset along both axes


def _levels(channels: int, width: int) -> nn.ModuleList:
    """Three levels, each half the size of the one before."""
    return nn.ModuleList(
        [
            nn.Sequential(conv(channels, width), conv(width, width)),
            nn.Sequential(conv(width, 2 * width, 2), conv(2 * width, 2 * width)),
            nn.Sequential(conv(2 * width, 4 * width, 2), conv(4 * width, 4 * width)),
        ]
    )


class FlowNet(LayerNet):
    """Planes, features, state and time -> occupancy, top, bottom, offset expected at the end; class logits.

    The outputs are those of the deterministic InpaintingNet. Works on 2 x 2 pixels at a time, which quarters the
    cost.
    """

    def __init__(self, classes: int, edges: tuple[float, ...], width: int = 32) -> None:
        super().__init__(edges)
        w = width
        self.fold, self.unfold = nn.PixelUnshuffle(2), nn.PixelShuffle(2)
        self.measured, self.noisy = _levels(4 * PLANES, w), _levels(4 * STATE, w)
        self.inject = nn.Linear(FEATURES, 4 * w)
        self.when = nn.ModuleList(
            [nn.Sequential(nn.Linear(1, 32), nn.ReLU(), nn.Linear(32, size)) for size in (w, 2 * w, 4 * w)]
        )
        self.rise = nn.ModuleList([nn.Conv2d(4 * w, 2 * w, 1), nn.Conv2d(2 * w, w, 1)])
        self.up = nn.ModuleList(
            [
                nn.Sequential(conv(4 * w, 2 * w), conv(2 * w, 2 * w)),
                nn.Sequential(conv(2 * w, w), conv(w, w)),
            ]
        )
        self.head = nn.Conv2d(w, 4 * STATE, 1)
        self.classify = nn.Sequential(
            nn.Conv2d(4 * w, 32, 1), nn.ReLU(), nn.Flatten(), nn.Dropout(0.2), nn.Linear(32 * 4 * 8, classes)
        )

    def forward(self, planes: Tensor, features: Tensor, state: Tensor, time: Tensor) -> tuple[Tensor, ...]:
        """Image, features, state (n, 15, 32, 64) and time (n,) to the outputs named above, in that order."""
        levels, classes = self.encode(planes, features)
        return *self.decode(levels, state, time), classes

    def encode(self, planes: Tensor, features: Tensor) -> tuple[list[Tensor], Tensor]:
        """What was measured, level by level, and the class logits."""
        image, levels = self.fold(planes), []
        for block in self.measured:
            image = block(image)
            levels.append(image)
        levels[-1] = image + self.inject(features)[:, :, None, None]
        return levels, self.classify(levels[-1])

    def decode(self, measured: list[Tensor], state: Tensor, time: Tensor) -> tuple[Tensor, ...]:
        """Occupancy, top, bottom (n, 3, 32, 64) and offset (n, 2, 3, 32, 64) expected behind a noisy state."""
        image, levels = self.fold(state), []
        for block, when, known in zip(self.noisy, self.when, measured, strict=True):
            image = block(image) + when(time[:, None])[:, :, None, None] + known
            levels.append(image)
        for rise, up, skipped in zip(self.rise, self.up, reversed(levels[:-1]), strict=True):
            lifted = nn.functional.interpolate(rise(image), scale_factor=2.0, mode="nearest")
            image = up(torch.cat([lifted, skipped], dim=1))
        return self.bounded(self.unfold(self.head(image)))

    def state_of(self, occupancy: Tensor, top: Tensor, bottom: Tensor, offset: Tensor) -> Tensor:
        """The state (n, 15, 32, 64) of a vessel, or the one expected: each channel in [-1, 1], 0 where empty.

        With occupancy a probability and the others their means where there is surface, this is the mean of the
        states: an empty cell is 0 in all channels but its own occupancy, which is -1.
        """
        heights = [occupancy * (2 * (height - self.lower) / self.thickness - 1) for height in (top, bottom)]
        offsets = (2 * offset * occupancy[:, None]).flatten(1, 2)
        return torch.cat([2 * occupancy - 1, *heights, offsets], dim=1)
