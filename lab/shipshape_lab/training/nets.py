"""The networks, small enough for one CPU core: what goes in and out is what the stages of the service expect."""

import torch
from torch import Tensor, nn

from shipshape.first_look import NEIGHBOURS


def conv(channels_in: int, channels_out: int, stride: int = 1) -> nn.Sequential:
    """A 3 x 3 convolution, batch norm and ReLU; a stride of 2 halves the image."""
    return nn.Sequential(
        nn.Conv2d(channels_in, channels_out, 3, stride, 1, bias=False),
        nn.BatchNorm2d(channels_out),
        nn.ReLU(inplace=True),
    )


class _Encoder(nn.Module):
    """Strided convolutions, each followed by one at the same size; image and features to one vector."""

    def __init__(self, planes: int, shape: tuple[int, int], features: int, width: int = 24) -> None:
        super().__init__()
        self.image = nn.Sequential(
            conv(planes, width, 2),
            conv(width, width),
            conv(width, 2 * width, 2),
            conv(2 * width, 2 * width),
            conv(2 * width, 4 * width, 2),
            conv(4 * width, 4 * width),
            conv(4 * width, 4 * width, 2),
        )
        cells = (shape[0] // 16) * (shape[1] // 16)
        self.mix = nn.Sequential(
            nn.Linear(4 * width * cells + features, 192), nn.ReLU(inplace=True), nn.Dropout(0.1)
        )

    def forward(self, planes: Tensor, features: Tensor) -> Tensor:
        """Image (n, planes, rows, columns) and features (n, f) to (n, 192)."""
        return self.mix(torch.cat([self.image(planes).flatten(1), features], dim=1))


class AlignedNet(nn.Module):
    """The roughly aligned cluster -> turn and log of its spread, flip logit, shift, log size, class logits."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.encode = _Encoder(9, (32, 64), 3)
        self.turn, self.flip = nn.Linear(192, 2), nn.Linear(192, 1)
        self.shift, self.size, self.classes = nn.Linear(192, 3), nn.Linear(192, 3), nn.Linear(192, classes)

    def forward(self, planes: Tensor, features: Tensor) -> tuple[Tensor, ...]:
        """Image and features to the outputs named above, in that order."""
        seen = self.encode(planes, features)
        turn = self.turn(seen)
        turn = torch.cat([0.6 * torch.tanh(turn[:, :1]), turn[:, 1:].clamp(-7.0, 1.0)], dim=1)
        return turn, self.flip(seen), self.shift(seen), self.size(seen), self.classes(seen)


def _pointwise(channels_in: int, channels_out: int) -> nn.Sequential:
    # A 1 x 1 convolution over points: the quantiser knows it, and batch norm folds into it.
    return nn.Sequential(
        nn.Conv2d(channels_in, channels_out, 1, bias=False),
        nn.BatchNorm2d(channels_out),
        nn.ReLU(inplace=True),
    )


class PointsNet(nn.Module):
    """The first look (`shipshape.first_look`): groups of points along the line of sight -> what they are part of.

    Two rounds of PointNet++ and one network over all that is left; every round ends in the greatest of each
    feature, so that an element that comes twice changes nothing.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.near = nn.Sequential(_pointwise(6, 48), _pointwise(48, 48), _pointwise(48, 96))
        self.far = nn.Sequential(_pointwise(3 + 96, 96), _pointwise(96, 96), _pointwise(96, 192))
        # A pool, not a maximum over a dimension: the quantiser knows it.
        self.greatest = nn.MaxPool2d((1, NEIGHBOURS))
        self.rest = nn.Sequential(_pointwise(3 + 192, 192), _pointwise(192, 512))
        self.mix = nn.Sequential(
            nn.Linear(512 + 3, 256), nn.ReLU(), nn.Dropout(0.2), nn.Linear(256, 192), nn.ReLU(), nn.Dropout(0.1)
        )
        self.axis, self.shift, self.size = nn.Linear(192, 2), nn.Linear(192, 2), nn.Linear(192, 3)
        self.bow, self.classes = nn.Linear(192, 2), nn.Linear(192, classes)

    def forward(
        self, near: Tensor, members: Tensor, far: Tensor, centres: Tensor, features: Tensor
    ) -> tuple[Tensor, ...]:
        """Inputs of `first_look.network_inputs` in batches of n.

        Returns:
            (n, 2) sine and cosine of the doubled angle of the axis; (n, 2) shift of the middle in units of 10 m;
            (n, 3) log size; (n, 2) half the log-odds that the bow points along x, along y; (n, classes) logits.
        """
        groups = self.greatest(self.near(near)).squeeze(3).transpose(1, 2)
        n, most, _ = groups.shape
        rows = members + most * torch.arange(n, device=members.device)[:, None]
        # Whole rows: to gather along the last axis takes ten times as long.
        known = groups.flatten(0, 1)[rows.flatten()].reshape(n, -1, NEIGHBOURS, 96).permute(0, 3, 1, 2)
        known = self.greatest(self.far(torch.cat([far, known], dim=1)))
        whole = self.rest(torch.cat([centres, known], dim=1)).amax(dim=(2, 3))
        seen = self.mix(torch.cat([whole, features], dim=1))
        return self.axis(seen), self.shift(seen), self.size(seen) + 2.0, self.bow(seen), self.classes(seen)


class UNet(nn.Module):
    """Four levels; the bottleneck is handed out beside the full-size features."""

    def __init__(self, planes: int, width: int) -> None:
        super().__init__()
        w = width
        self.down = nn.ModuleList(
            [
                nn.Sequential(conv(planes, w), conv(w, w)),
                nn.Sequential(conv(w, 2 * w, 2), conv(2 * w, 2 * w)),
                nn.Sequential(conv(2 * w, 4 * w, 2), conv(4 * w, 4 * w)),
                nn.Sequential(conv(4 * w, 8 * w, 2), conv(8 * w, 8 * w)),
            ]
        )
        self.rise = nn.ModuleList([nn.Conv2d(8 * w, 4 * w, 1), nn.Conv2d(4 * w, 2 * w, 1), nn.Conv2d(2 * w, w, 1)])
        self.up = nn.ModuleList(
            [
                nn.Sequential(conv(8 * w, 4 * w), conv(4 * w, 4 * w)),
                nn.Sequential(conv(4 * w, 2 * w), conv(2 * w, 2 * w)),
                nn.Sequential(conv(2 * w, w), conv(w, w)),
            ]
        )

    def encode(self, image: Tensor) -> list[Tensor]:
        """Features of each level, full size first."""
        levels = []
        for block in self.down:
            image = block(image)
            levels.append(image)
        return levels

    def decode(self, levels: list[Tensor], bottleneck: Tensor) -> Tensor:
        """Full-size features from the bottleneck and the skipped levels."""
        image = bottleneck
        for rise, up, skipped in zip(self.rise, self.up, reversed(levels[:-1]), strict=True):
            lifted = nn.functional.interpolate(rise(image), scale_factor=2.0, mode="nearest")
            image = up(torch.cat([lifted, skipped], dim=1))
        return image


class LayerNet(nn.Module):
    """A network that tells layers of surface, heights within their `edges` (shares of the depth range)."""

    def __init__(self, edges: tuple[float, ...]) -> None:
        super().__init__()
        lower = torch.tensor(edges[:-1], dtype=torch.float32).view(1, -1, 1, 1)
        upper = torch.tensor(edges[1:], dtype=torch.float32).view(1, -1, 1, 1)
        self.register_buffer("lower", lower)
        self.register_buffer("thickness", upper - lower)

    def bounded(self, out: Tensor) -> tuple[Tensor, ...]:
        """(n, 15, 32, 64) of any number to occupancy, top, bottom (n, 3, 32, 64) and offset (n, 2, 3, 32, 64).

        Heights stay in their layer, bottoms under their top, offsets in their cell.
        """
        top = torch.sigmoid(out[:, 3:6])
        bottom = top * torch.sigmoid(out[:, 6:9])
        return (
            torch.sigmoid(out[:, 0:3]),
            self.lower + self.thickness * top,
            self.lower + self.thickness * bottom,
            0.5 * torch.tanh(out[:, 9:15]).unflatten(1, (2, 3)),
        )


class InpaintingNet(LayerNet):
    """Aligned planes and their mirror -> occupancy, top, bottom, sub-cell offset of each layer; class logits.

    A U-Net at half the image's size, which tells four cells at each place: what was measured is laid over its
    answer in full size anyway.
    """

    def __init__(self, classes: int, edges: tuple[float, ...]) -> None:
        super().__init__(edges)
        near, middle, far = 32, 64, 128
        self.down = nn.ModuleList(
            [
                nn.Sequential(conv(18, near, 2), conv(near, near)),
                nn.Sequential(conv(near, middle, 2), conv(middle, middle)),
                nn.Sequential(conv(middle, far, 2), conv(far, far), conv(far, far)),
            ]
        )
        self.inject = nn.Linear(3, far)
        self.rise = nn.ModuleList([nn.Conv2d(far, middle, 1), nn.Conv2d(middle, near, 1)])
        self.up = nn.ModuleList(
            [nn.Sequential(conv(width, width), conv(width, width)) for width in (middle, near)]
        )
        self.head = nn.Conv2d(near, 4 * 15, 1)
        self.classify = nn.Sequential(
            nn.Conv2d(far, 32, 1), nn.ReLU(), nn.Flatten(), nn.Dropout(0.2), nn.Linear(32 * 4 * 8, classes)
        )

    def forward(self, planes: Tensor, features: Tensor) -> tuple[Tensor, ...]:
        """Image and features to the outputs named above, in that order."""
        levels = [planes]
        for block in self.down:
            levels.append(block(levels[-1]))
        bottleneck = image = levels[-1] + self.inject(features)[:, :, None, None]
        for rise, up, skipped in zip(self.rise, self.up, (levels[2], levels[1]), strict=True):
            image = up(nn.functional.interpolate(rise(image), scale_factor=2.0, mode="nearest") + skipped)
        out = nn.functional.pixel_shuffle(self.head(image), 2)
        return *self.bounded(out), self.classify(bottleneck)


class GreyNet(nn.Module):
    """The paper's inpainting: grey image in [0, 1], three layers as channels -> the same, completed.

    Works on 2 x 2 pixels at a time, which quarters the cost of every level.
    """

    def __init__(self, width: int = 16) -> None:
        super().__init__()
        self.fold, self.unfold = nn.PixelUnshuffle(2), nn.PixelShuffle(2)
        self.unet = UNet(12, width)
        self.head = nn.Conv2d(width, 12, 1)

    def forward(self, image: Tensor) -> Tensor:
        """(n, 3, 64, 64) to the same."""
        levels = self.unet.encode(self.fold(image))
        return torch.sigmoid(self.unfold(self.head(self.unet.decode(levels, levels[-1]))))


class Spd2Net(nn.Module):
    """The "standard CNN": SPD2 image (5, 16, 32) -> class logits."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            conv(5, 24),
            nn.MaxPool2d(2),
            conv(24, 48),
            nn.MaxPool2d(2),
            conv(48, 64),
            nn.MaxPool2d(2),
            nn.Flatten(),
            nn.Dropout(0.3),
            nn.Linear(64 * 2 * 4, 96),
            nn.ReLU(),
            nn.Linear(96, classes),
        )

    def forward(self, images: Tensor) -> Tensor:
        """(n, 5, 16, 32) to (n, classes)."""
        return self.layers(images)
