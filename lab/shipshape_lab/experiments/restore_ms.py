"""How long PCN, SnowflakeNet and `best` take to restore a cluster, on one CPU core and a GPU if there is one.

    python -m shipshape_lab.experiments.restore_ms --data runs/data --bundle models --out runs/results

Clusters of P with at least 2,048 points, thinned to exactly as many, take turns, and so do the systems, so that
all of them meet the same disturbances. Each is timed from the cluster and its pose to the restored cloud: `best`
by projection, inpainting and lifting, the networks alone, batch 1, in torch and in ONNX Runtime. They are of their
published size, for which untrained weights do; `reduced` is the size that was trained on a CPU. What counts on a
CPU is the time that its one thread had the processor: a busy machine stretches the elapsed time of what takes long
far more than that of what is short, which would flatter `best`. Elapsed time counts on a GPU, and is kept beside.
"""

import argparse
import os
import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import nn
from tqdm import tqdm

from shipshape.bundle import load_bundle
from shipshape.onnx_model import OnnxModel
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, Options
from shipshape_lab.completion.clouds import to_unit
from shipshape_lab.completion.plans import MODELS, PLANS
from shipshape_lab.experiments import outcome
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.restore_ms_figure import draw
from shipshape_lab.experiments.systems import BEST, Run
from shipshape_lab.simulator.clusters import ClusterSet, load
from shipshape_lab.training.export import export

POINTS = 2048
CLUSTERS = 12
WARM_UP = 2
_BEFORE = ("prior", "heading", "bow_stern")
_TIMED = ("projection", "inpainting", "lifting")
System = Callable[[Run], object]  # restores a cluster whose pose has been found


def contacts_of(clusters: ClusterSet) -> list[Contact]:
    """Contacts of exactly POINTS points, spread evenly over the clusters that have as many.

    Raises:
        ValueError: no cluster has.
    """
    large = np.flatnonzero(clusters.n >= POINTS)
    if len(large) == 0:
        raise ValueError(f"expected clusters of at least {POINTS} points, got at most {clusters.n.max()}")
    rng = np.random.default_rng(5)
    contacts = []
    for i in large[np.linspace(0, len(large) - 1, CLUSTERS).astype(int)]:
        points = clusters.cluster(int(i))
        contacts.append(Contact(points[np.sort(rng.choice(len(points), POINTS, replace=False))]))
    return contacts


def cloud_of(run: Run) -> np.ndarray:
    """The cluster as the completion networks see it, (1, POINTS, 3)."""
    return to_unit(run.work.contact.points_level, run.work.pose)[None]


def in_torch(net: nn.Module, device: str) -> System:
    """The network in eager torch, from an array to an array."""
    net = net.to(device)

    @torch.inference_mode()
    def run(work: Run) -> np.ndarray:
        return net(torch.from_numpy(cloud_of(work)).to(device))[-1].cpu().numpy()

    return run


def in_onnx(net: nn.Module, folder: Path, name: str) -> System:
    """The network in ONNX Runtime on one thread, proven equal to torch."""
    outputs = [f"cloud_{i}" for i in range(len(net(torch.rand(1, POINTS, 3))))]
    export(net, {"cloud": torch.rand(1, POINTS, 3)}, outputs, folder / f"{name}.onnx")
    model = OnnxModel(folder / f"{name}.onnx")
    return lambda work: model.run(cloud=cloud_of(work))


def systems_of(pipeline: Pipeline, folder: Path) -> dict[str, System]:
    """Every system by its name in the numbers; those on a GPU end in .gpu."""
    systems: dict[str, System] = {BEST: lambda run: run.branch(Options()).through(pipeline, _TIMED)}
    for model in MODELS:
        torch.manual_seed(1)
        full, reduced = (PLANS[model, schedule].net().eval() for schedule in ("full", "reduced"))
        systems[f"{model}_onnx"] = in_onnx(full, folder, model)
        systems[f"{model}_torch"] = in_torch(full, "cpu")
        systems[f"{model}_reduced"] = in_torch(reduced, "cpu")
        if torch.cuda.is_available():
            systems[f"{model}.gpu"] = in_torch(PLANS[model, "full"].net().eval(), "cuda")
    return systems


def measure(systems: dict[str, System], runs: list[Run], turns: int) -> dict[str, np.ndarray]:
    """Elapsed and processor milliseconds of every system, (turns, 2); warm-up is left out."""
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in systems}
    for turn in tqdm(range(WARM_UP + turns), desc="restore_ms", mininterval=2.0):
        for name, restore in systems.items():
            started, busy = time.perf_counter(), time.process_time()
            restore(runs[turn % len(runs)])
            times[name].append((time.perf_counter() - started, time.process_time() - busy))
    return {name: 1e3 * np.array(found[WARM_UP:]) for name, found in times.items()}


def numbers_of(times: dict[str, np.ndarray]) -> Numbers:
    """Medians; a network's time is that of torch or of ONNX Runtime, whichever is less."""
    medians = {name: np.median(found, axis=0) for name, found in times.items()}
    for model in MODELS:
        medians[model] = min(medians[f"{model}_torch"], medians[f"{model}_onnx"], key=lambda both: both[1])
    found = {
        f"P.restore_ms.{name}": float(elapsed if name.endswith(".gpu") else processor)
        for name, (elapsed, processor) in medians.items()
    }
    found |= {f"P.restore_elapsed_ms.{name}": float(elapsed) for name, (elapsed, _) in medians.items()}
    ours = found[f"P.restore_ms.{BEST}"]
    return found | {f"P.restore_times_faster.{model}": found[f"P.restore_ms.{model}"] / ours for model in MODELS}


def machine() -> str:
    """The processor, and the GPU if there is one."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    gpu = f", {torch.cuda.get_device_name()}" if torch.cuda.is_available() else ""
    return f"{names[0] if names else platform.machine()}, {os.cpu_count()} cores{gpu}"


def main(argv: list[str] | None = None) -> None:
    """Measure, write OUT/restore_ms.json and the figure."""
    args = _parser().parse_args(argv)
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    bundle = load_bundle(args.bundle)
    pipeline = Pipeline(bundle)
    contacts = contacts_of(load(args.data / "P.npz"))
    runs = [Run(pipeline.begin(contact, Options())).through(pipeline, _BEFORE) for contact in contacts]
    with tempfile.TemporaryDirectory() as folder:
        found = numbers_of(measure(systems_of(pipeline, Path(folder)), runs, args.turns))
    about = {"bundle_digest": bundle.digest, "seed": 5, "turns": args.turns, "machine": machine()}
    path = outcome.write(args.out, "restore_ms", found, **about)
    print("\n".join(f"{name:<40}{value:10.3f}" for name, value in found.items()))
    print(f"wrote {path} and {draw(found, args.figures)}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument(
        "--figures", type=Path, default=Path("docs/figures"), help="folder for figures (default docs/figures)"
    )
    parser.add_argument("--turns", type=int, default=48, help="clusters that each system restores (default 48)")
    return parser


if __name__ == "__main__":
    main()
