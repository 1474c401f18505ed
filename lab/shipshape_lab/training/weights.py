"""A trained network that stays in the lab: its weights, and beside them what belongs to them."""

import json
from pathlib import Path

import torch
from torch import nn


def write(folder: Path, net: nn.Module, name: str, about: dict) -> None:
    """Weights to weights.pt, then `about` to the JSON file `name`: a folder that has that file is whole."""
    folder.mkdir(parents=True, exist_ok=True)
    torch.save(net.state_dict(), folder / "weights.pt")
    (folder / name).write_text(json.dumps(about, indent=2) + "\n")
