"""From a catalogue of meshes to a verified bundle and its report, in one command.

    shipshape-lab fleet fleet.toml --to fleet/bundle --quick
    shipshape-lab fleet fleet.toml --check

The meshes are checked first: errors stop, warnings do not unless --strict is given. Then data, networks,
calibration, bundle and evaluation are made in WORK (default: the bundle's folder with -work behind it), and
WORK/REPORT.md says what came of it. Stopped at any time, the same command goes on.

The full plan trains every network from nothing. --quick trains on a fifth of the scans and starts pose and
inpainting from the networks of a finished bundle (--start); experiments/real_catalogue measures what that costs.
"""

import argparse
import hashlib
import json
import resource
import sys
import time
from pathlib import Path

from shipshape_lab.commit import code_commit
from shipshape_lab.fleet.checks import check_catalogue
from shipshape_lab.fleet.mesh_checks import Finding
from shipshape_lab.fleet.plan import FULL, QUICK
from shipshape_lab.fleet.report import write_report
from shipshape_lab.fleet.runner import run_steps
from shipshape_lab.fleet.steps import Order, steps_of
from shipshape_lab.simulator.catalogue import Catalogue, MeshVessel, read_catalogue


def main(argv: list[str] | None = None) -> None:
    """Check, train, evaluate, report."""
    parser = _parser()
    args = parser.parse_args(argv)
    if not args.check and not args.to:
        parser.error("expected --to BUNDLE_DIR, or --check to look at the meshes alone")
    try:
        catalogue = read_catalogue(args.catalogue)
        findings = check_catalogue(catalogue)
        _tell(catalogue, findings, strict=args.strict)
        if not args.check:
            _make(_order(args), catalogue, findings)
    except (ValueError, RuntimeError) as error:
        parser.exit(1, f"{parser.prog}: {error}\n")


def _tell(catalogue: Catalogue, findings: list[Finding], *, strict: bool) -> None:
    for finding in findings:
        print(finding)
    if any(finding.stops or strict for finding in findings):
        raise ValueError(f"expected meshes without {'findings' if strict else 'errors'}, got those above")
    print(f"{len(catalogue.entries)} vessels checked, {len(findings)} warnings")


def _order(args: argparse.Namespace) -> Order:
    work = args.work or args.to.with_name(f"{args.to.name}-work")
    if args.quick and not (args.start / "manifest.toml").is_file():
        raise ValueError(f"expected a bundle to start from in {args.start}, got none: name one with --start")
    return Order(args.catalogue, args.to, work, QUICK if args.quick else FULL, args.lanes, args.start)


def _make(order: Order, catalogue: Catalogue, findings: list[Finding]) -> None:
    _claim(order, catalogue)
    spent = _Spent(order.work / "spent.json")
    try:
        run_steps(steps_of(order), lanes=order.lanes, logs=order.work / "logs")
    finally:
        spent.keep()
    report = write_report(order, catalogue, findings, spent.read())
    print(f"bundle in {order.bundle}, report in {report}")


def _claim(order: Order, catalogue: Catalogue) -> None:
    """Let a folder be of one catalogue and one plan, so that nothing of another is taken up.

    Raises:
        ValueError: the folder is of another one.
    """
    meshes = (entry.mesh for entry in catalogue.entries if isinstance(entry, MeshVessel))
    files = [hashlib.sha256(path.read_bytes()).hexdigest()[:16] for path in (order.catalogue, *meshes)]
    wanted = json.dumps({"plan": order.plan.name, "catalogue and meshes": files}, indent=2) + "\n"
    path = order.work / "of.json"
    order.work.mkdir(parents=True, exist_ok=True)
    if path.exists() and path.read_text() != wanted:
        raise ValueError(
            f"expected {order.work} to be of this catalogue, its meshes and the plan {order.plan.name}, "
            "but one of them changed: name another folder with --work, or delete it"
        )
    if not path.exists() and (order.bundle / "manifest.toml").exists():
        raise ValueError(f"expected no bundle in {order.bundle} yet, got one: name another folder with --to")
    path.write_text(wanted)


class _Spent:
    """Minutes of the clock and of the processors over all runs in a folder, with the code that ran last."""

    def __init__(self, path: Path) -> None:
        self._path, self._began = path, time.monotonic()

    def read(self) -> dict:
        """What was spent so far."""
        return json.loads(self._path.read_text()) if self._path.exists() else {"minutes": 0.0, "processor": 0.0}

    def keep(self) -> None:
        """Add what this run spent."""
        before, used = self.read(), resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = {
            "minutes": round(before["minutes"] + (time.monotonic() - self._began) / 60.0, 2),
            "processor": round(before["processor"] + (used.ru_utime + used.ru_stime) / 60.0, 2),
            "code": code_commit(),
        }
        self._path.write_text(json.dumps(spent) + "\n")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="shipshape-lab fleet", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("catalogue", type=Path, help="TOML file with a [[vessel]] table for each vessel")
    parser.add_argument("--to", type=Path, help="folder of the finished bundle")
    parser.add_argument("--check", action="store_true", help="check the meshes and stop")
    parser.add_argument("--strict", action="store_true", help="stop at warnings too")
    parser.add_argument("--quick", action="store_true", help="a first bundle within twenty minutes")
    parser.add_argument("--lanes", type=int, default=2, help="processes side by side (default 2)")
    parser.add_argument("--work", type=Path, help="folder for data, networks, logs and report (default TO-work)")
    parser.add_argument(
        "--start", type=Path, default=Path("models"), help="bundle that a quick run starts from (default models)"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
