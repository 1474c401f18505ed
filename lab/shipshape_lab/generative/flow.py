"""Rectified flow: a straight path from noise to a vessel, learnt, then walked in a few Euler steps.

On the path, state = (1 - time) noise + time vessel, so the velocity at a state is (expected vessel - state) / (1
- time). The network says the expected vessel, in the terms of the deterministic restorer: cross-entropy of the
occupancy and squared errors of the rest have that mean as their least. One step is then plain regression, and
the last of several ends on the vessel that is expected behind the state it starts from, so its outputs lift as
they are.

Source: Liu, Gong and Liu, "Flow straight and fast", ICLR 2023; Lipman et al., "Flow matching", ICLR 2023.
"""

import numpy as np
import torch
from torch import Tensor, nn

from shipshape_lab.generative.net import STATE, FlowNet

STEPS = (1, 2, 4, 8)
AT_START = 0.25  # share of training at time 0, where every walk starts and a walk of one step also ends
NOISE_SHAPE = (STATE, 32, 64)


def moment(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Noise, and a time in [0, 1) on the path from it."""
    time = 0.0 if rng.random() < AT_START else rng.random()
    return {"noise": rng.standard_normal(NOISE_SHAPE, np.float32), "time": np.float32(time)}


def on_path(noise: Tensor, vessel: Tensor, time: Tensor) -> Tensor:
    """The state at a time (n,) between noise and vessel (n, 15, 32, 64)."""
    share = time[:, None, None, None]
    return (1 - share) * noise + share * vessel


def loss_of(net: FlowNet, batch: dict[str, Tensor]) -> Tensor:
    """Cross-entropy of occupancy, squared errors of heights and offsets where there is surface, and the class."""
    there = batch["occupied"]
    vessel = net.state_of(there, batch["top"], batch["bottom"], batch["offset"])
    state = on_path(batch["noise"], vessel, batch["time"])
    outputs = net(batch["planes"], batch["features"], state, batch["time"])
    occupancy, top, bottom, offset, classes = (out.float() for out in outputs)
    occupancy = occupancy.clamp(1e-5, 1 - 1e-5)
    entropy = -(there * occupancy.log() + (1 - there) * (1 - occupancy).log()).mean()
    cells = there.sum() + 1.0
    heights = ((top - batch["top"]).square() + (bottom - batch["bottom"]).square()) * there
    offsets = (offset - batch["offset"]).square().sum(dim=1) * there
    return (
        3.0 * entropy
        + 100.0 * heights.sum() / cells
        + 1.0 * offsets.sum() / cells
        + 0.3 * nn.functional.cross_entropy(classes, batch["label"], label_smoothing=0.02)
    )


class Sampler(nn.Module):
    """Planes, features and noise -> occupancy, top, bottom, offset and class logits, after `steps` Euler steps."""

    def __init__(self, net: FlowNet, steps: int) -> None:
        super().__init__()
        self.net, self.steps = net, steps

    def forward(self, planes: Tensor, features: Tensor, noise: Tensor) -> tuple[Tensor, ...]:
        """Image (n, 18, 32, 64), features (n, 3) and noise (n or 1, 15, 32, 64) to the outputs named above."""
        measured, classes = self.net.encode(planes, features)
        state = noise
        for left in range(self.steps, 0, -1):
            time = torch.full((1,), 1 - left / self.steps)
            expected = self.net.decode(measured, state, time)
            # A step of 1 / steps at 1 / (1 - time) = steps / left times the way to go.
            state = state + (self.net.state_of(*expected) - state) / left
        return *expected, classes
