r"""Train PCN or SnowflakeNet on the clusters and poses of preset `best`'s inpainting.

    python -m shipshape_lab.completion.train --model pcn --data runs/data --out runs/completion
    python -m shipshape_lab.completion.train --model snowflakenet --data runs/data --out runs/completion_full \
        --schedule full

Both learn from the same set and the same disturbed poses as inpainting, by AdamW on a one-cycle schedule whose
length is chosen beforehand: `plans.PLANS` holds what `reduced` (the default, for a CPU) and `full` (the published
configuration, for a GPU) mean. After each round CD-L1 on 200 validation clusters is kept, so that a reader sees
how far it has converged; at the end 1,000 decide whether measured points are added to what the network draws.
Stopped and started again, training goes on after the last whole round.
"""

import argparse
import json
import logging
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn

from shipshape_lab.commit import code_commit
from shipshape_lab.completion import validate
from shipshape_lab.completion.clouds import to_item
from shipshape_lab.completion.load import Completer
from shipshape_lab.completion.plans import MODELS, PLANS, SCHEDULES, Plan, loss_of
from shipshape_lab.training import arguments, loop, weights
from shipshape_lab.training.examples import Examples

IN_BETWEEN = 200  # validation clusters after a round
AT_THE_END = 1000
log = logging.getLogger(__name__)


class Rounds(loop.Drawn):
    """A part of the examples each epoch, the next part in the next one; all of them if a round holds as many."""

    def __init__(self, examples: Examples, plan: Plan, seed: int) -> None:
        def draw(i: int, rng: np.random.Generator) -> dict:
            return to_item(examples.drawn(i, rng), (plan.seen, plan.target), rng)

        super().__init__(np.random.default_rng(seed).permutation(examples.indices), draw, seed)
        self._length = min(plan.clusters, len(examples))

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, item: int) -> dict:
        return super().__getitem__((self.epoch * self._length + item) % len(self._indices))


class Progress:
    """Validation after every round, kept in a file that a resumed run adds to."""

    def __init__(self, path: Path, completer: Completer, validation: Examples) -> None:
        self._path, self._completer = path, completer
        self._clusters = validate.drawn(validation, IN_BETWEEN)
        self.rounds: dict[str, dict] = json.loads(path.read_text()) if path.exists() else {}
        self._started = time.process_time()

    def after(self, done: int) -> None:
        """Score the network as it is."""
        spent = time.process_time() - self._started
        self._completer.net.eval()
        found = validate.scores(self._completer.complete, self._clusters)
        self.rounds[str(done)] = {**found, "cpu_s": round(spent)}
        self._path.write_text(json.dumps(self.rounds, indent=1) + "\n")
        log.info("round %d: %s", done, self.rounds[str(done)])
        self._started = time.process_time()


def trained(args: argparse.Namespace, plan: Plan, validation: Examples) -> tuple[nn.Module, dict]:
    """The network, and its validation scores by round."""
    checkpoint = args.out / f"checkpoints/{args.model}_{args.schedule}.pt"
    checkpoint.parent.mkdir(parents=True, exist_ok=True)
    net = plan.net()
    progress = Progress(
        checkpoint.with_suffix(".json"), Completer(args.model, net, plan.seen, with_measured=True), validation
    )
    data = Rounds(Examples.read(args.data, "train"), plan, args.seed)
    loop.train(net, data, loss_of, plan.schedule(args.seed), checkpoint, progress.after)
    return net, progress.rounds


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, validate and write."""
    args = _arguments(argv)
    torch.manual_seed(args.seed)
    plan, validation = PLANS[args.model, args.schedule], Examples.read(args.data, "validation")
    net, rounds = trained(args, plan, validation)
    completer = Completer(args.model, net, plan.seen, with_measured=True)
    helps, found = validate.measured_helps(completer, validate.drawn(validation, AT_THE_END))
    about = {
        "schedule": args.schedule,
        "with_measured": helps,
        "validation": found,
        "rounds": rounds,
        "parameters": sum(values.numel() for values in net.parameters()),
        "training": {"seed": args.seed, "commit": code_commit(), "clusters": plan.rounds * plan.clusters},
    }
    weights.write(args.out / args.model, net, "completer.json", about)
    print(f"{args.model}, {args.schedule}: {found}")


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", choices=MODELS, required=True, help="which network")
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument(
        "--out", type=Path, required=True, help="folder for checkpoints/ and a folder for each network"
    )
    parser.add_argument("--schedule", choices=SCHEDULES, default="reduced", help="how long (default reduced)")
    return arguments.prepared(parser, argv)


if __name__ == "__main__":
    main()
