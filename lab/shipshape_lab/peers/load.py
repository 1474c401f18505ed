"""Trained peers, each asked the same question as the service: contact in, calibrated class probabilities out.

    for peer in load_peers(Path("runs/peers")):
        print(peer.name, peer.classify(contact))

A peer is a folder with weights.pt and peer.json (catalogue, temperature, validation scores).
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from shipshape.bundle import CatalogueVessel
from shipshape.softmax import softmax
from shipshape.stages import keypoints, spd2
from shipshape.stages.keypoints import KeypointParams
from shipshape.types import Contact, ReferenceBox
from shipshape_lab.peers import mirrored
from shipshape_lab.peers.clouds import network_inputs
from shipshape_lab.peers.pointnet import PointNet
from shipshape_lab.peers.pointnet2 import PointNet2
from shipshape_lab.training.nets import Spd2Net
from shipshape_lab.training.train_spd2 import RADIUS

NETWORKS = {"pointnet": PointNet, "pointnet2": PointNet2, "mirrored_spd2": Spd2Net}
Logits = Callable[[Contact], np.ndarray]


@dataclass(frozen=True)
class Peer:
    """One trained competitor.

    Attributes:
        name: as in the results, one of NETWORKS.
        logits: contact to class logits, (k, classes): one row, or one for each keypoint.
        temperature: fitted on the validation set.
    """

    name: str
    logits: Logits
    temperature: float

    def classify(self, contact: Contact) -> np.ndarray:
        """Calibrated probabilities (classes,) float32; the last class is "unknown".

        Raises:
            InvalidInput: the peer needs a pose, and the contact cannot be one vessel's cluster.
        """
        return softmax(self.logits(contact) / np.float32(self.temperature)).mean(axis=0)


def load_peers(folder: Path) -> list[Peer]:
    """The peers that have been trained in `folder`; those that have not are absent."""
    return [load_peer(folder / name) for name in NETWORKS if (folder / name / "peer.json").exists()]


def load_peer(folder: Path) -> Peer:
    """One trained peer; the folder has its name."""
    about = json.loads((folder / "peer.json").read_text())
    catalogue = [CatalogueVessel(vessel["name"], ReferenceBox(**vessel["box"])) for vessel in about["catalogue"]]
    net = NETWORKS[folder.name](len(catalogue) + 1)
    net.load_state_dict(torch.load(folder / "weights.pt", weights_only=True, map_location="cpu"))
    return Peer(folder.name, answering(folder, net.eval(), catalogue), about["temperature"])


def answering(folder: Path, net: nn.Module, catalogue: Sequence[CatalogueVessel]) -> Logits:
    """How the peer that lives in `folder` makes logits of a contact."""
    if isinstance(net, Spd2Net):
        return _by_descriptors(net, folder, catalogue)
    return _by_points(net)


def _by_points(net: nn.Module) -> Logits:
    def logits(contact: Contact) -> np.ndarray:
        # A seed of its own for every contact: the answer to one does not depend on what was asked before.
        inputs = network_inputs(contact, np.random.default_rng(0))
        return _run(net, *(torch.as_tensor(inputs[name])[None] for name in ("points", "count", "features")))

    return logits


def _by_descriptors(net: nn.Module, folder: Path, catalogue: Sequence[CatalogueVessel]) -> Logits:
    pipeline = mirrored.pose_pipeline(folder, catalogue)

    def logits(contact: Contact) -> np.ndarray:
        cloud = mirrored.mirrored_cloud(pipeline, contact)
        densest = keypoints.select_keypoints(cloud, KeypointParams())
        return _run(net, torch.from_numpy(spd2.describe(cloud, densest, RADIUS)))

    return logits


@torch.inference_mode()
def _run(net: nn.Module, *inputs: Tensor) -> np.ndarray:
    return net(*inputs).numpy()
