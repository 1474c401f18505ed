"""The steps from a catalogue to an evaluated bundle: what each one runs, leaves behind and waits for."""

from dataclasses import dataclass
from pathlib import Path

from shipshape.types import ImageMethod
from shipshape_lab.fleet.plan import Plan
from shipshape_lab.training.waves import WAVES, network_file

# Seconds of one core, in the full and in the quick plan; they only weigh the progress bar and the time left.
SECONDS = {
    "train": (900, 200),
    "validation": (200, 80),
    "start": (0, 20),
    "points": (2900, 270),
    "inpainting": (2200, 190),
    "aligned": (1000, 180),
    "inpainting_": (200, 30),
    "prior": (280, 60),
    "parts": (170, 30),
    "spd2": (430, 90),
    "spd2_": (240, 60),
    "bundle": (150, 80),
    "evaluation": (150, 150),
}
NEEDS = {"spd2": ("inpainting", "aligned", "points")}
for _method in ImageMethod:
    NEEDS[f"spd2_{_method}"] = (f"inpainting_{_method}", "prior", "parts")


@dataclass(frozen=True)
class Order:
    """What a run is about.

    Attributes:
        catalogue: the TOML file.
        bundle: folder of the finished bundle.
        work: folder for everything else.
        plan: how much of everything.
        lanes: processes side by side.
        start: folder of the bundle whose networks a quick run starts from.
    """

    catalogue: Path
    bundle: Path
    work: Path
    plan: Plan
    lanes: int
    start: Path

    @property
    def data(self) -> Path:
        """Folder of the data sets."""
        return self.work / "data"

    @property
    def networks(self) -> Path:
        """Folder of checkpoints and trained networks."""
        return self.work / "networks"

    @property
    def evaluation(self) -> Path:
        """File of what the finished bundle said of other scans."""
        return self.work / "evaluation.json"


@dataclass(frozen=True)
class Step:
    """One process: `python -m module arguments` leaves the file `made`, after the steps that it needs."""

    name: str
    module: str
    arguments: tuple[str, ...]
    made: Path
    seconds: float
    needs: tuple[str, ...] = ()
    alone: bool = False  # uses every lane itself


def steps_of(order: Order) -> list[Step]:
    """All steps in an order in which one lane can take them."""
    sets = [_data_step(order, name) for name in ("train", "validation")]
    made = tuple(step.name for step in sets)
    starting = [_start_step(order, made)] if order.plan.starts_from_bundle else []
    ready = made + tuple(step.name for step in starting)
    networks = [_network_step(order, step, ready) for wave in WAVES for step in wave]
    trained = tuple(step.name for step in networks)
    return [*sets, *starting, *networks, _bundle_step(order, trained), _evaluation_step(order)]


def _seconds(order: Order, name: str) -> float:
    for kind in ("inpainting_", "spd2_"):
        name = kind if name.startswith(kind) else name
    return float(SECONDS[name][order.plan.name == "quick"])


def _data_step(order: Order, name: str) -> Step:
    count = {"train": order.plan.clusters, "validation": order.plan.validation}[name]
    arguments = [name, "--catalogue", order.catalogue, "--out", order.data, "--jobs", order.lanes]
    arguments += ["--count", count] if count else []
    arguments += ["--hulls", order.plan.hulls] if order.plan.hulls else []
    return Step(
        name,
        "shipshape_lab.simulator.datasets",
        tuple(map(str, arguments)),
        order.data / f"{name}_surfaces.npz",
        _seconds(order, name),
        alone=True,
    )


def _start_step(order: Order, needs: tuple[str, ...]) -> Step:
    arguments = ["--from", order.start, "--data", order.data, "--out", order.networks, "--plan", order.plan.name]
    made = order.networks / "started"
    module, seconds = "shipshape_lab.fleet.start", _seconds(order, "start")
    return Step("start", module, tuple(map(str, arguments)), made, seconds, needs)


def _network_step(order: Order, step: tuple[str, ...], ready: tuple[str, ...]) -> Step:
    name = network_file(step).removesuffix(".onnx")
    arguments = [*step[1:], "--data", order.data, "--out", order.networks, "--threads", "1"]
    arguments += ["--epochs", order.plan.epochs_of(name)] if order.plan.epochs else []
    return Step(
        name,
        f"shipshape_lab.training.train_{step[0]}",
        tuple(map(str, arguments)),
        order.networks / "bundle" / f"{name}.onnx",
        _seconds(order, name),
        ready + NEEDS.get(name, ()),
    )


def _bundle_step(order: Order, needs: tuple[str, ...]) -> Step:
    arguments = ["--data", order.data, "--out", order.networks, "--to", order.bundle]
    arguments += ["--name", order.catalogue.stem]
    module = "shipshape_lab.training.build_bundle"
    made, seconds = order.bundle / "manifest.toml", _seconds(order, "bundle")
    return Step("bundle", module, tuple(map(str, arguments)), made, seconds, needs)


def _evaluation_step(order: Order) -> Step:
    arguments = ["--catalogue", order.catalogue, "--bundle", order.bundle, "--out", order.evaluation]
    module, seconds = "shipshape_lab.fleet.evaluate", _seconds(order, "evaluation")
    return Step("evaluation", module, tuple(map(str, arguments)), order.evaluation, seconds, ("bundle",))
