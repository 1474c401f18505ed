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

from shipshape_lab.training.fake_quantise import rounded

log = logging.getLogger(__name__)

SETTLING_RATE = 3e-4  # peak; the weights have found their place and only learn to bear the rounding

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


class _Run:
    """A network with its optimiser and rate schedule: what a checkpoint holds."""

    def __init__(self, net: nn.Module, steps: int, rate: float) -> None:
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self.net = net.to(self.device)
        self.optimizer = torch.optim.AdamW(net.parameters(), lr=rate, weight_decay=1e-3)
        self.rates = torch.optim.lr_scheduler.OneCycleLR(
            self.optimizer, rate, total_steps=max(steps, 2), pct_start=0.15
        )

    def step(self, batch: Batch, loss_of: Callable[[nn.Module, Batch], Tensor]) -> float:
        """One step of the optimiser; returns the loss."""
        on_device = {name: value.to(self.device) for name, value in batch.items()}
        with torch.autocast(self.device.type, torch.bfloat16):
            loss = loss_of(self.net, on_device)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(self.net.parameters(), 5.0)
        self.optimizer.step()
        self.rates.step()
        return float(loss.detach())

    def resume(self, checkpoint: Path) -> int:
        """Take up the checkpoint, if there is one; returns the epochs done.

        Raises:
            ValueError: it is of another schedule, whose rates cannot be carried on.
        """
        if not checkpoint.exists():
            return 0
        state = torch.load(checkpoint, weights_only=True, map_location=self.device)
        steps, kept = self.rates.total_steps, state["rates"]["total_steps"]
        if steps != kept:
            raise ValueError(
                f"expected a checkpoint of {steps} steps in all, got one of {kept}: "
                f"give the same --epochs and --data, or delete {checkpoint} to start again"
            )
        for name in ("net", "optimizer", "rates"):
            getattr(self, name).load_state_dict(state[name])
        return int(state["epoch"])

    def keep(self, checkpoint: Path, epoch: int) -> None:
        """Write the checkpoint; a run that is killed leaves the last whole one."""
        checkpoint.parent.mkdir(parents=True, exist_ok=True)
        draft = checkpoint.with_suffix(".part")
        parts = {name: getattr(self, name).state_dict() for name in ("net", "optimizer", "rates")}
        torch.save(parts | {"epoch": epoch}, draft)
        draft.replace(checkpoint)


def train(
    net: nn.Module,
    data: Drawn,
    loss_of: Callable[[nn.Module, Batch], Tensor],
    schedule: Schedule,
    checkpoint: Path,
    after_epoch: Callable[[int], None] = lambda done: None,
) -> nn.Module:
    """Train `net` in place and return it, in evaluation mode on the CPU.

    Args:
        net: freshly made network.
        data: training examples.
        loss_of: network and batch to a scalar loss.
        schedule: epochs, batch, rate, seed.
        checkpoint: file that the state is kept in after every epoch; a run that was stopped goes on from it.
        after_epoch: told how many epochs are done, before the checkpoint of them is written.
    """
    run = _Run(net, schedule.epochs * (len(data) // schedule.batch), schedule.rate)
    for epoch in range(run.resume(checkpoint), schedule.epochs):
        data.epoch = epoch
        net.train()
        title = f"{checkpoint.stem} {epoch + 1}/{schedule.epochs}"
        bar = tqdm(_loader(data, schedule, epoch), desc=title, leave=False, mininterval=2.0)
        losses = [run.step(batch, loss_of) for batch in bar]
        log.info("%s loss %.4f", title, float(np.mean(losses)))
        after_epoch(epoch + 1)
        run.keep(checkpoint, epoch + 1)
    return net.cpu().eval()


def keep_start(net: nn.Module, data: Drawn, schedule: Schedule, checkpoint: Path) -> None:
    """Write a checkpoint of no epoch yet: `train` starts from it with these weights and this schedule's rate."""
    steps = schedule.epochs * (len(data) // schedule.batch)
    _Run(net, steps, schedule.rate).keep(checkpoint, 0)


def train_for_int8(
    net: nn.Module,
    draws: Callable[[int], Drawn],
    loss_of: Callable[[nn.Module, Batch], Tensor],
    schedule: Schedule,
    checkpoint: Path,
) -> nn.Module:
    """Train `net` as `train` does, then settle it into the rounding of int8 for one epoch more.

    Args:
        net: freshly made network.
        draws: seed to training examples; the settling epoch draws others than the first one did.
        loss_of: as in `train`.
        schedule: of the epochs before.
        checkpoint: as in `train`; the settling epoch keeps its own beside it.
    """
    net = train(net, draws(schedule.seed), loss_of, schedule, checkpoint)
    settling = Schedule(1, schedule.batch, SETTLING_RATE, schedule.seed + 1)
    beside = checkpoint.with_name(f"{checkpoint.stem}_int8.pt")
    return train(rounded(net), draws(settling.seed), loss_of, settling, beside)


def _loader(data: Drawn, schedule: Schedule, epoch: int) -> DataLoader:
    order = torch.Generator().manual_seed(schedule.seed * 1000 + epoch)
    return DataLoader(data, schedule.batch, shuffle=True, drop_last=True, generator=order)
