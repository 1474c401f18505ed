"""Set R: five real meshes registered as a fleet, trained on sister hulls, asked about other scans of the meshes.

    python -m shipshape_lab.experiments.real_catalogue --meshes DIR --work runs/real --quick
    python -m shipshape_lab.experiments.real_catalogue --meshes DIR --work runs/real

The bundle is what `shipshape-lab fleet` makes of a catalogue of five meshes, in its quick or its full plan. It
learns from hulls stretched by 3 % (sd) along each axis; R shows the meshes themselves at the paper's distances, 30
to 110 m, in 40 headings, at ranges and headings that training keeps away from. R_hard shows sister hulls of other
seeds in a sea, occluded, thinned, by three sensors, up to 200 m.

The five were chosen before anything was trained: one each of five types that a harbour meets, 10 to 45 m long, two
of them 2 m apart. Left out are ships of 50 m and more, a raft of 5 m, the sailing yacht, whose mast gives it away,
and two open boats of the RHIB's size.

OUT/real_catalogue.json holds the numbers of every plan that was finished in WORK; those without a plan in their
key are of the full one, or of the quick one where there is no full one yet.
"""

import argparse
import json
from pathlib import Path

from shipshape_lab.commit import code_commit
from shipshape_lab.fleet import command
from shipshape_lab.fleet.report import draw_results

FLEET = {
    "rhib": "bc_hurricane_rhib",
    "fishing_boat": "gz_fishingboat",
    "trawler_yacht": "oc_trawleryacht",
    "tug": "oc_tugboat",
    "landing_craft": "bc_hmas_brunei",
}
PLANS = ("quick", "full")
SETS = {"calm": "R", "hard": "R_hard"}
NAME = "real_catalogue"


def write_catalogue(meshes: Path, path: Path) -> Path:
    """The catalogue of the five meshes, every other value as the fleet command has it."""
    tables = (
        f'[[vessel]]\nname = "{name}"\nmesh = {json.dumps(str((meshes / mesh).resolve().with_suffix(".ply")))}\n'
        for name, mesh in FLEET.items()
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(tables))
    return path


def numbers_of(work: Path) -> dict[str, float]:
    """Flat numbers of every plan that was finished; shares in [0, 1], minutes of the clock and of processors."""
    numbers: dict[str, float] = {}
    for plan in PLANS:
        if not (work / plan / "evaluation.json").exists():
            continue
        found = json.loads((work / plan / "evaluation.json").read_text())
        spent = json.loads((work / plan / "spent.json").read_text())
        for part, name in SETS.items():
            for key, value in found[part]["numbers"].items():
                quantity, _, rest = key.partition(".")
                slices = f".{rest}" if rest else ""
                numbers[f"{name}.{quantity}.best{slices}"] = value
                numbers[f"{name}.{quantity}.best{slices}.{plan}"] = value
        numbers[f"R.minutes.{plan}"] = spent["minutes"]
        numbers[f"R.processor_minutes.{plan}"] = spent["processor"]
    return numbers


def main(argv: list[str] | None = None) -> None:
    """Make the bundle, or go on making it, and write the numbers and the figure."""
    args = _parser().parse_args(argv)
    plan = PLANS[0] if args.quick else PLANS[1]
    catalogue = write_catalogue(args.meshes, args.work / "harbour.toml")
    order = [str(catalogue), "--to", str(args.work / f"{plan}-bundle"), "--work", str(args.work / plan)]
    order += ["--lanes", str(args.lanes), "--start", str(args.start)]
    command.main([*order, "--quick"] if args.quick else order)
    done = [name for name in PLANS if (args.work / name / "evaluation.json").exists()]
    about = {
        "code": code_commit(),
        "seed": 1,
        "meshes": FLEET,
        "plans": done,
        "machine": args.machine,
    }
    args.out.mkdir(parents=True, exist_ok=True)
    content = {"about": about, "numbers": numbers_of(args.work)}
    (args.out / f"{NAME}.json").write_text(json.dumps(content, indent=2, sort_keys=True) + "\n")
    best = json.loads((args.work / done[-1] / "evaluation.json").read_text())
    draw_results(best, args.figures / f"{NAME}.png")
    print(f"accuracy on R {100 * content['numbers']['R.accuracy.best']:.2f} %, plan {done[-1]}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=Path, required=True, help="folder of the five .ply meshes")
    parser.add_argument("--work", type=Path, required=True, help="folder for catalogue, bundles and work folders")
    parser.add_argument("--out", type=Path, default=Path("runs/results"), help="folder for the numbers")
    parser.add_argument("--figures", type=Path, default=Path("docs/figures"), help="folder for the figure")
    parser.add_argument("--quick", action="store_true", help="the quick plan instead of the full one")
    parser.add_argument("--lanes", type=int, default=2, help="processes side by side (default 2)")
    parser.add_argument("--start", type=Path, default=Path("models"), help="bundle that a quick run starts from")
    parser.add_argument("--machine", default="2 CPU cores", help="what it runs on, for the report")
    return parser


if __name__ == "__main__":
    main()
