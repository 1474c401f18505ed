"""Make the default bundle from nothing: data sets, networks, calibration. Stopped and started again, it goes on.

    python -m shipshape_lab.training.train_all --work runs --to models

Networks that do not need each other train side by side, one on each core; each writes its own progress bar and
log to WORK/logs. Use --lanes 1 on one core or one GPU.
"""

import argparse
import logging
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from shipshape_lab.simulator.catalogue import DEFAULT, same_vessels
from shipshape_lab.simulator.clusters import load_catalogue
from shipshape_lab.training import build_bundle
from shipshape_lab.training.waves import WAVES, network_file

log = logging.getLogger(__name__)

DATA_SETS = ("train", "validation")


def train_step(step: tuple[str, ...], work: Path) -> None:
    """Train one network in a process of its own, unless its file is there.

    Raises:
        RuntimeError: the training failed; its log says why.
    """
    if (work / "default/bundle" / network_file(step)).exists():
        return
    folders = ["--data", str(work / "data"), "--out", str(work / "default"), "--threads", "1"]
    name = network_file(step).removesuffix(".onnx")
    _run(f"shipshape_lab.training.train_{step[0]}", [*step[1:], *folders], work, name)


def make_data(name: str, work: Path, lanes: int) -> None:
    """Make a data set of the default catalogue, unless it is there; one of another catalogue stays."""
    made = work / "data" / f"{name}.npz"
    if made.exists() and not same_vessels(load_catalogue(made), DEFAULT.vessels()):
        return
    arguments = [name, "--out", str(work / "data"), "--jobs", str(lanes)]
    _run("shipshape_lab.simulator.datasets", arguments, work, f"data_{name}")


def _run(module: str, arguments: list[str], work: Path, name: str) -> None:
    path = work / "logs" / f"{name}.log"
    path.parent.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    with path.open("w") as output:
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments], stdout=output, stderr=output, env=environment, check=False
        )
    if done.returncode:
        raise RuntimeError(f"expected {name} to finish, but it stopped with code {done.returncode}: see {path}")
    log.info("%s done in %.0f s", name, time.monotonic() - started)


def main(argv: list[str] | None = None) -> None:
    """Make, or go on making, the default bundle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, required=True, help="folder for data, checkpoints and logs")
    parser.add_argument("--to", type=Path, required=True, help="folder of the finished bundle")
    parser.add_argument("--lanes", type=int, default=2, help="networks trained side by side (default 2)")
    args = parser.parse_args(argv)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", datefmt="%H:%M:%S")
    for name in DATA_SETS:
        make_data(name, args.work, args.lanes)
    for wave in WAVES:
        with ThreadPoolExecutor(args.lanes) as lanes:
            list(lanes.map(lambda step: train_step(step, args.work), wave))
    build_bundle.main(
        ["--data", str(args.work / "data"), "--out", str(args.work / "default"), "--to", str(args.to)]
    )


if __name__ == "__main__":
    main()
