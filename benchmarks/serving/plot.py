"""The results as a picture: a bar a server, for what it costs and for its tail."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.serving.servers import Server
from benchmarks.serving.summary import TARGETS, Flat

OURS, PEER, LIMIT = "#0b6e99", "#b4b4b4", "#444444"
PANELS = {
    "efficiency": "processor time of the bare pipeline / of the server",
    "p99_over_p50": "p99 / p50 at 70 % of its capacity",
}


def draw(numbers: Flat, servers: Sequence[Server], path: Path) -> None:
    """Write the picture; servers without numbers are left out."""
    shown = sorted(
        (server for server in servers if f"efficiency.{server.name}" in numbers),
        key=lambda server: float(numbers[f"efficiency.{server.name}"]),
    )
    names = [f"Shipshape {server.name}" if server.ours else server.name for server in shown]
    figure = Figure(figsize=(10, 1.2 + 0.34 * len(shown)), layout="constrained")
    for axes, (key, title) in zip(figure.subplots(1, len(PANELS), sharey=True), PANELS.items(), strict=True):
        middle = [float(numbers[f"{key}.{server.name}"]) for server in shown]
        least = [float(numbers[f"least.{key}.{server.name}"]) for server in shown]
        most = [float(numbers[f"most.{key}.{server.name}"]) for server in shown]
        errors = [
            [a - b for a, b in zip(middle, least, strict=True)],
            [a - b for a, b in zip(most, middle, strict=True)],
        ]
        colours = [OURS if server.ours else PEER for server in shown]
        bars = axes.barh(
            names,
            middle,
            color=colours,
            xerr=errors,
            error_kw={"ecolor": LIMIT, "lw": 1},
        )
        for label, server in zip(axes.bar_label(bars, fmt="%.2f", label_type="center"), shown, strict=True):
            label.set(color="white" if server.ours else "black", fontsize=8)
        axes.set_title(title, fontsize=10, loc="left")
        axes.spines[["top", "right"]].set_visible(False)
    efficiency, tail = figure.axes
    efficiency.axvline(1.0, color=LIMIT, lw=1, ls=":")
    tail.axvline(TARGETS["p99_over_p50.at_70pct"][1], color=LIMIT, lw=1, ls=":")
    figure.savefig(path, dpi=130)
