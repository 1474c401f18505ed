"""The command line that every training script shares."""

import argparse
import logging
from collections.abc import Sequence
from pathlib import Path

import torch


def parse(
    description: str | None, argv: list[str] | None, *, epochs: int, **choices: Sequence[str]
) -> argparse.Namespace:
    """Parse --data, --out, --epochs, --seed and --threads, and set up logging and torch's threads.

    Args:
        description: the script's help text.
        argv: the arguments, those of the process if None.
        epochs: the default of --epochs.
        **choices: further options that must be given, by name, each one of some values.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--out", type=Path, required=True, help="folder for checkpoints/ and bundle/")
    parser.add_argument("--epochs", type=int, default=epochs, help=f"passes over the data (default {epochs})")
    for name, values in choices.items():
        parser.add_argument(f"--{name}", choices=[str(value) for value in values], required=True)
    return prepared(parser, argv)


def prepared(parser: argparse.ArgumentParser, argv: list[str] | None) -> argparse.Namespace:
    """Parse what the parser has, with --seed and --threads beside it, and set up logging and torch's threads."""
    parser.add_argument("--seed", type=int, default=1, help="seed of initialisation and draws (default 1)")
    parser.add_argument("--threads", type=int, default=0, help="CPU threads (default: all)")
    args = parser.parse_args(argv)
    if args.threads:
        torch.set_num_threads(args.threads)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", datefmt="%H:%M:%S")
    return args
