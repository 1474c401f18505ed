"""Measure, print the table, write serving.json, serving.md and serving.png.

    python -m benchmarks.serving                      # three rounds of everything, an hour on a quiet machine
    python -m benchmarks.serving --quick --only rest_binary mosec

Run it in the root of the checkout. What a round of a server gave is kept in the run folder: a run that was stopped
goes on where it was, and a server that failed is tried again.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from tqdm import tqdm

from benchmarks.pipeline import machine
from benchmarks.serving import environments, page, plot, summary
from benchmarks.serving.bare import Limit
from benchmarks.serving.measure import Numbers, Plan, measure, scaling
from benchmarks.serving.servers import SERVERS, Server
from shipshape.bundle import load_bundle
from shipshape_lab.commit import code_commit

COMMAND = "python -m benchmarks.serving"
SCALING = "scaling"  # the file of what is measured apart from the servers


def main() -> int:
    """Run the benchmark; 1 if a server gave no numbers."""
    args = _parser().parse_args()
    if args.quick:
        args.rounds, args.seconds = 1, 2.0
        args.run, args.out = args.run / "quick", args.run / "quick"
    plan = _plan(args)
    _keep_to(plan, args.run)
    with Limit(plan.server_cores, plan.seed) as limit:
        _measure_all(args, plan, limit)
    numbers: summary.Flat = {**_about(args, plan), **summary.flat(summary.read(args.run))}
    _report(numbers, args.out)
    return int(any(key.startswith(summary.FAILED) for key in numbers))


def _measure_all(args: argparse.Namespace, plan: Plan, limit: Limit) -> None:
    chosen = [server for server in SERVERS if not args.only or server.name in args.only]
    tasks: dict[str, Callable[[Path], Numbers]] = {}
    for server in tqdm(chosen, desc="preparing", leave=False):
        tasks[server.name] = _task(server, plan, limit)
    if not args.only or SCALING in args.only:
        tasks[SCALING] = partial(scaling, plan)
    turns = [(turn, name) for turn in range(1, args.rounds + 1) for name in tasks]
    for turn, name in (progress := tqdm(turns, leave=False)):
        progress.set_description(f"round {turn}: {name}")
        _once(args.run / f"round-{turn}" / f"{name}.json", tasks[name])


def _task(server: Server, plan: Plan, limit: Limit) -> Callable[[Path], Numbers]:
    """What measures it; of a server that cannot be prepared, what says so."""
    try:
        environments.prepare(server)
    except RuntimeError as error:
        return partial(_refuse, error)
    return partial(measure, server, plan, limit)


def _refuse(error: RuntimeError, log: Path) -> Numbers:
    raise error


def _once(file: Path, task: Callable[[Path], Numbers]) -> None:
    """Keep what the task gives, or why it gave nothing; nothing is done if the file holds numbers already."""
    if file.exists() and summary.FAILED not in json.loads(file.read_text()):
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    try:
        found: dict = dict(task(file.with_suffix(".log")))
    except Exception as error:  # whatever a peer does, the others are measured
        found = {summary.FAILED: str(error) or repr(error)}
    file.write_text(json.dumps(found, indent=1) + "\n")


def _plan(args: argparse.Namespace) -> Plan:
    cores = sorted(os.sched_getaffinity(0))
    if not 1 <= args.cores <= len(cores):
        raise SystemExit(f"expected --cores of the {len(cores)} usable ones, got {args.cores}")
    rest = cores[: -args.cores] or cores  # with none left over, the generator shares them
    return Plan(args.seconds, tuple(cores[-args.cores :]), tuple(rest), args.seed)


def _keep_to(plan: Plan, run: Path) -> None:
    """Rounds of one run folder are all of one plan, and of the same code: else a median would be of neither."""
    run.mkdir(parents=True, exist_ok=True)
    kept, text = run / "plan.txt", f"{plan} of code {code_commit()}"
    if kept.exists() and kept.read_text() != text:
        raise SystemExit(f"expected the rounds of {run}, {kept.read_text()}, got {text}: choose another --run")
    kept.write_text(text)


def _about(args: argparse.Namespace, plan: Plan) -> summary.Flat:
    on = machine()
    installed = (server for server in SERVERS if server.python.exists())
    return {
        "about.measured": datetime.now(UTC).strftime("%Y-%m-%d"),
        "about.code": code_commit(),
        "about.bundle": load_bundle(Path("models")).digest,
        "about.machine": f"{on['processor']}, {on['cores']} cores, {on['system']}",
        "about.cores": f"{len(plan.server_cores)} for the server, {len(plan.client_cores)} for the load generator",
        "about.rounds": args.rounds,
        "about.seconds": plan.seconds,
        **{f"version.{server.name}": environments.version(server) for server in installed},
    }


def _report(numbers: summary.Flat, out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    (out / "serving.json").write_text(json.dumps(numbers, indent=1) + "\n")
    (out / "serving.md").write_text(page.page(numbers, SERVERS, COMMAND))
    plot.draw(numbers, SERVERS, out / "serving.png")
    print(page.table(numbers, SERVERS))
    for sentence in summary.short_of_targets(numbers):
        print(f"short of its target: {sentence}")


def _parser() -> argparse.ArgumentParser:
    names = [*(server.name for server in SERVERS), SCALING]
    parser = argparse.ArgumentParser(
        prog=COMMAND, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=names, metavar="NAME", help=f"of {', '.join(names)}")
    parser.add_argument("--rounds", type=int, default=3, help="of every server in turns (default 3)")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each measurement (default 10)")
    parser.add_argument("--quick", action="store_true", help="one round of 2 seconds: does everything work?")
    parser.add_argument("--cores", type=int, default=1, help="of a server; others generate load (default 1)")
    parser.add_argument("--run", type=Path, default=Path("runs/serving/run"), help="folder of the rounds")
    parser.add_argument("--out", type=Path, default=Path("benchmarks/results"), help="folder of the results")
    parser.add_argument("--seed", type=int, default=5, help="of contacts and arrivals (default 5)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
