"""The report of a fleet's bundle: what it was trained with, how long that took, what it can do and confuses."""

import json
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shipshape.bundle import UNKNOWN
from shipshape_lab.fleet.mesh_checks import Finding
from shipshape_lab.fleet.steps import Order
from shipshape_lab.simulator.catalogue import Catalogue, MeshVessel
from shipshape_lab.simulator.render import contact_sheet

COLOUR, OTHER = "#0072B2", "#D55E00"
SETS = {
    "calm": "other scans of the same meshes, 30 to 110 m, calm sea",
    "hard": "sister hulls in a sea, occluded, thinned, three sensors, 30 to 200 m",
}
ROWS = {
    "accuracy": "right vessel, when one of the catalogue must be named",
    "accuracy_named": "right vessel and not called unknown",
    "unknown_found": "vessels and things outside of the catalogue called unknown",
    "known_kept": "vessels of the catalogue not called unknown",
    "heading.within_5deg": "heading within 5 degrees, modulo pi",
    "bow_stern": "bow and stern told apart",
}


def write_report(order: Order, catalogue: Catalogue, findings: list[Finding], spent: dict) -> Path:
    """Write REPORT.md and its two pictures into the order's work folder."""
    found = json.loads(order.evaluation.read_text())
    contact_sheet([(name, catalogue.build(name).mesh) for name in catalogue.names], order.work / "vessels.png")
    draw_results(found, order.work / "results.png")
    path = order.work / "REPORT.md"
    path.write_text("\n".join(_lines(order, catalogue, findings, spent, found)) + "\n")
    return path


def _lines(order: Order, catalogue: Catalogue, findings: list[Finding], spent: dict, found: dict) -> list[str]:
    sizes = zip(catalogue.entries, catalogue.boxes(), strict=True)
    return [
        f"# Bundle {found['bundle']}",
        "",
        f"Digest {found['bundle_digest'][:16]}, made by code {spent['code']} in {spent['minutes']:.0f} minutes "
        f"({spent['processor']:.0f} minutes of processor), plan `{order.plan.name}`. {trained_with(order)}",
        "",
        "![the vessels](vessels.png)",
        "",
        "| vessel | from | length, m | beam, m | height above water, m |",
        "|---|---|---|---|---|",
        *(
            f"| {entry.name} | {entry.mesh.name if isinstance(entry, MeshVessel) else entry.type} "
            f"| {box.length:.1f} | {box.beam:.1f} | {box.height:.1f} |"
            for entry, box in sizes
        ),
        "",
        "What the check of the meshes said:",
        "",
        *([f"- {finding}" for finding in findings] or ["- nothing"]),
        "",
        "## What it can do",
        "",
        *results_table(found),
        "",
        "![accuracy and confusions](results.png)",
        "",
        "Everything here is simulated: real scans will be worse where the meshes differ from the vessels.",
    ]


def trained_with(order: Order) -> str:
    """One or two sentences on how the networks came to be."""
    plan = order.plan
    if not plan.starts_from_bundle:
        return "Every network was trained from nothing, as the default bundle's are."
    return (
        f"{plan.clusters:,} scans of {plan.hulls} sister hulls a vessel; pose and inpainting started from the "
        f"networks of `{order.start}`. A run without --quick trains on five times as many scans."
    )


def results_table(found: dict) -> list[str]:
    """A table of shares, a column for each set."""
    head = " | ".join(f"{text} ({found[name]['numbers']['clusters']} scans)" for name, text in SETS.items())
    lines = [f"| | {head} |", "|---|---|---|"]
    for key, text in ROWS.items():
        values = (f"{100 * found[name]['numbers'][key]:.1f} %" for name in SETS)
        lines.append(f"| {text} | {' | '.join(values)} |")
    values = (f"{found[name]['numbers']['auroc']:.3f}" for name in SETS)
    return [*lines, f"| unknown against known, area under the curve | {' | '.join(values)} |"]


def draw_results(found: dict, path: Path) -> None:
    """Who is taken for whom on the calm set, and accuracy by range on both."""
    figure = Figure(figsize=(11.0, 4.6), dpi=100, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1.0))
    _confusion(left, [*found["names"], UNKNOWN], np.array(found["calm"]["confusion"]))
    _ranges(right, found)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Software": None})


def _confusion(axes: Axes, names: list[str], counts: np.ndarray) -> None:
    shares = 100.0 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=100.0)
    for (row, column), share in np.ndenumerate(shares):
        if counts[row, column]:
            colour = "white" if share > 60.0 else "black"
            axes.text(column, row, f"{share:.1f}", ha="center", va="center", color=colour, fontsize=8)
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right", fontsize=8)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.set_xlabel("answered, % of the row", fontsize=9)
    axes.set_ylabel("true", fontsize=9)
    axes.set_title("who is taken for whom, calm", fontsize=10, loc="left")


def _ranges(axes: Axes, found: dict) -> None:
    for name, colour in zip(SETS, (COLOUR, OTHER), strict=True):
        numbers = found[name]["numbers"]
        bands = {key.split(".")[1]: 100 * value for key, value in numbers.items() if key.startswith("accuracy.")}
        edges = [tuple(map(float, band.removesuffix("m").split("_"))) for band in bands]
        middles = [(max(low, 30.0) + high) / 2 for low, high in edges]
        axes.plot(middles, list(bands.values()), marker="o", color=colour, label=name)
    axes.set_xlabel("range, m", fontsize=9)
    axes.set_ylabel("right vessel, %", fontsize=9)
    axes.set_ylim(top=min(100.0, axes.get_ylim()[1]) + 0.02)
    axes.grid(color="0.9")
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title("accuracy by range", fontsize=10, loc="left")
    axes.legend(fontsize=9)
