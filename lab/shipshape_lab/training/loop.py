"""One training loop for every network: progress bar, checkpoints, resumes where it stopped, CPU or CUDA."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader, Dataset
from tqdm import tqdm

log = logging.getLogger(__name__)

Batch = dict[str, Tensor]


@dataclass(frozen=True)
class Schedule:
    """How long and how fast to train."""

    epochs: int
    batch: int = 64
    rate: float = 2e-3  # peak of the one-cycle schedule
    seed: int = 1


class Drawn(Dataset):
    """Examples drawn afresh every epoch: item i of epoch e depends on (seed, e, i) alone."""

    def __init__(self, indices: np.ndarray, draw: Callable[[int, np.random.Generator], dict], seed: int) -> None:
        self._indices, self._draw, self._seed, self.epoch = indices, draw, seed, 0

    def __len__(self) -> int:
        return len(self._indices)

    def __getitem__(self, item: int) -> dict:
        index = int(self._indices[item])
        return self._draw(index, np.random.default_rng([self._seed, self.epoch, index]))


def train(
    net: nn.Module,
    data: Drawn,
    loss_of: Callable[[nn.Module, Batch], Tensor],
    schedule: Schedule,
    checkpoint: Path,
) -> nn.Module:
    """Train `net` in place and return it, in evaluation mode on the CPU.

    Args:
        net: freshly made network.
        data: training examples.
        loss_of: network and batch to a scalar loss.
        schedule: epochs, batch, rate, seed.
        checkpoint: file that the state is kept in after every epoch; a run that was stopped goes on from it.
    """
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    net.to(device)
    optimizer = torch.optim.AdamW(net.parameters(), lr=schedule.rate, weight_decay=1e-3)
    steps = schedule.epochs * (len(data) // schedule.batch)
    rates = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, schedule.rate, total_steps=max(steps, 2), pct_start=0.15
    )
    first = _resume(checkpoint, net, optimizer, rates)
    for epoch in range(first, schedule.epochs):
        data.epoch = epoch
        loader = _loader(data, schedule, epoch)
        mean = _one_epoch(
            net.train(),
            loader,
            loss_of,
            optimizer,
            rates,
            device,
            f"{checkpoint.stem} {epoch + 1}/{schedule.epochs}",
        )
        log.info("%s epoch %d/%d loss %.4f", checkpoint.stem, epoch + 1, schedule.epochs, mean)
        _keep(checkpoint, net, optimizer, rates, epoch + 1)
    return net.cpu().eval()


def _loader(data: Drawn, schedule: Schedule, epoch: int) -> DataLoader:
    order = torch.Generator().manual_seed(schedule.seed * 1000 + epoch)
    return DataLoader(data, schedule.batch, shuffle=True, drop_last=True, generator=order)


def _one_epoch(net, loader, loss_of, optimizer, rates, device, title) -> float:
    total = 0.0
    for batch in tqdm(loader, desc=title, leave=False, mininterval=2.0):
        batch = {name: value.to(device) for name, value in batch.items()}
        with torch.autocast(device.type, torch.bfloat16):
            loss = loss_of(net, batch)
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimizer.step()
        rates.step()
        total += float(loss.detach())
    return total / max(len(loader), 1)


def _resume(checkpoint: Path, net, optimizer, rates) -> int:
    if not checkpoint.exists():
        return 0
    state = torch.load(checkpoint, weights_only=True)
    net.load_state_dict(state["net"])
    optimizer.load_state_dict(state["optimizer"])
    rates.load_state_dict(state["rates"])
    return int(state["epoch"])


def _keep(checkpoint: Path, net, optimizer, rates, epoch: int) -> None:
    checkpoint.parent.mkdir(parents=True, exist_ok=True)
    draft = checkpoint.with_suffix(".part")
    torch.save(
        {
            "net": net.state_dict(),
            "optimizer": optimizer.state_dict(),
            "rates": rates.state_dict(),
            "epoch": epoch,
        },
        draft,
    )
    draft.replace(checkpoint)
