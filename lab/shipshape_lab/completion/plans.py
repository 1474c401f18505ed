"""How large each network is and how long it is trained.

`full` is the published configuration and wants a GPU. `reduced` is what one CPU core does in half an hour (PCN)
and three quarters of an hour (SnowflakeNet): fewer points in and out, half the channels, half the neighbours. Both
end when a one-cycle schedule chosen beforehand has run out; nothing is stopped early.
"""

from dataclasses import dataclass

from torch import Tensor, nn

from shipshape_lab.completion.layers import chamfer_l1, to_nearest
from shipshape_lab.completion.pcn import Pcn, PcnSize
from shipshape_lab.completion.snowflakenet import SnowflakeNet, SnowflakeSize
from shipshape_lab.training.loop import Schedule

MODELS = ("pcn", "snowflakenet")
SCHEDULES = ("full", "reduced")


@dataclass(frozen=True)
class Plan:
    """One network on one schedule.

    Attributes:
        size: of the network.
        seen: points of the cluster that it sees.
        target: points of the complete surface that it is held to.
        clusters: drawn in one round; a round takes the place of an epoch.
        rounds: how many.
        batch: clusters in a step.
        rate: peak of the one-cycle schedule.
    """

    size: PcnSize | SnowflakeSize
    seen: int
    target: int
    clusters: int
    rounds: int
    batch: int
    rate: float = 1e-3

    def net(self) -> nn.Module:
        """The network, freshly made."""
        return Pcn(self.size) if isinstance(self.size, PcnSize) else SnowflakeNet(self.size)

    def schedule(self, seed: int) -> Schedule:
        """For the training loop."""
        return Schedule(self.rounds, self.batch, self.rate, seed)


PLANS = {
    ("pcn", "full"): Plan(PcnSize(), 2048, 16_384, 40_000, 50, 32),
    ("snowflakenet", "full"): Plan(SnowflakeSize(), 2048, 16_384, 40_000, 50, 32),
    ("pcn", "reduced"): Plan(PcnSize(512, 2, (64, 128, 256, 512), 256), 512, 2048, 8_000, 5, 16),
    ("snowflakenet", "reduced"): Plan(
        SnowflakeSize(256, 128, 256, (1, 2, 4), (128, 64), 8, 32), 512, 2048, 8_000, 4, 16
    ),
}


def loss_of(net: nn.Module, batch: dict[str, Tensor]) -> Tensor:
    """CD-L1 of every cloud that the network draws, coarse to dense, each to as many points of the surface at most.

    SnowflakeNet also pays for cluster points that its last cloud is far from, as published. PCN's published weight
    of the dense cloud, which grows during training, is 1 from the start.
    """
    clouds, target = net(batch["cloud"]), batch["target"]
    loss = sum(chamfer_l1(cloud, target[:, : cloud.shape[1]]) for cloud in clouds)
    return loss + to_nearest(batch["cloud"], clouds[-1]) if isinstance(net, SnowflakeNet) else loss
