"""Trained completion networks, each asked the same as the stages of the service: cluster and pose in, cloud out.

    for completer in load_completers(Path("runs/completion")):
        print(completer.name, completer.complete(points_level, pose).shape)

A network is a folder with weights.pt and completer.json (schedule, what was chosen on validation, scores).
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn

from shipshape.types import Pose
from shipshape_lab.completion.clouds import from_unit, resampled, to_unit
from shipshape_lab.completion.plans import MODELS, PLANS


@dataclass(frozen=True)
class Completer:
    """One trained network.

    Attributes:
        name: one of MODELS.
        net: in evaluation mode.
        seen: points that it takes.
        with_measured: whether the measured points are added to what it draws.
    """

    name: str
    net: nn.Module
    seen: int
    with_measured: bool

    @torch.inference_mode()
    def complete(self, points_level: np.ndarray, pose: Pose) -> np.ndarray:
        """The whole vessel.

        Args:
            points_level: cluster, (n, 3), m, level frame, n at least 1.
            pose: where the vessel is taken to lie, and its length.

        Returns:
            (m, 3) float32, level frame, m.
        """
        # A seed of its own for every cluster: the answer to one does not depend on what was asked before.
        seen = resampled(points_level, self.seen, np.random.default_rng(0))
        device = next(self.net.parameters()).device
        drawn = self.net(torch.from_numpy(to_unit(seen, pose))[None].to(device))[-1][0].cpu().numpy()
        whole = from_unit(drawn, pose)
        return np.concatenate([points_level, whole]) if self.with_measured else whole


def load_completers(folder: Path) -> list[Completer]:
    """The networks that have been trained in `folder`; those that have not are absent."""
    return [load_completer(folder / name) for name in MODELS if (folder / name / "completer.json").exists()]


def load_completer(folder: Path) -> Completer:
    """One trained network; the folder has its name."""
    about = json.loads((folder / "completer.json").read_text())
    plan = PLANS[folder.name, about["schedule"]]
    net = plan.net()
    net.load_state_dict(torch.load(folder / "weights.pt", weights_only=True, map_location="cpu"))
    return Completer(folder.name, net.eval(), plan.seen, about["with_measured"])


@dataclass(frozen=True)
class Training:
    """How long a network was trained.

    Attributes:
        schedule: one of SCHEDULES.
        clusters: drawn in all rounds together.
        last_gain: share of the CD-L1 on validation that the last round took away.
    """

    schedule: str
    clusters: int
    last_gain: float


def training_of(folder: Path) -> Training:
    """How the network in `folder`, which has its name, was trained."""
    about = json.loads((folder / "completer.json").read_text())
    plan = PLANS[folder.name, about["schedule"]]
    before, last = [scores["cd_l1"] for scores in about["rounds"].values()][-2:]
    return Training(about["schedule"], plan.rounds * plan.clusters, 1.0 - last / before)
