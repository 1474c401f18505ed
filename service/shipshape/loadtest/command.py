"""The command: send, judge, report; its exit code is the verdict."""

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from shipshape.errors import FileError
from shipshape.loadtest.budget import Verdict
from shipshape.loadtest.options import DEFAULT_RATE, LoadTest, options_of
from shipshape.loadtest.page import to_page
from shipshape.loadtest.processes import Processes
from shipshape.loadtest.progress import progress_of
from shipshape.loadtest.quantities import seconds_of
from shipshape.loadtest.report import Report, Step, sentence_on, this_machine, to_json, tool_version
from shipshape.loadtest.summary import Summary, summarise
from shipshape.loadtest.sweep import highest_held
from shipshape.loadtest.table import print_report, print_step

NOT_SETTINGS = ("command", "json", "report")  # arguments that say nothing of the load


def loadtest(arguments: argparse.Namespace) -> int:
    """Test a target as the arguments ask; 0 when it held the budget, see `Verdict.exit_code`.

    Raises:
        SettingsError, FileError, TargetError: Nothing could be tested.
    """
    test = options_of(arguments)
    for path in (arguments.json, arguments.report):
        if path is not None and not path.parent.is_dir():
            raise FileError(f"expected a folder {path.parent} to write {path.name} into, got none")
    with Processes(test.address, arguments.processes) as processes:
        report = _tested(arguments, test, processes)
    print_report(report)
    if arguments.json is not None:
        _write(arguments.json, to_json(report))
    if arguments.report is not None:
        _write(arguments.report, to_page(report).encode())
    return report.verdict.exit_code


def _tested(arguments: argparse.Namespace, test: LoadTest, processes: Processes) -> Report:
    started = datetime.now(UTC).isoformat(timespec="seconds")
    steps: list[Step] = []
    highest: float | None = None
    rate: float | None = arguments.rate
    if arguments.sweep:
        highest = _swept(arguments, test, processes, steps)
        rate = highest or steps[-1].rate
    run = steps[-1].summary if highest == 0 else _run(test, processes, rate, test.terms.seconds)
    verdict, sentence = run.verdict, sentence_on(run)
    if highest is not None:
        verdict, sentence = _on_sweep(highest, steps, run)
    return Report(
        started=started,
        tool=tool_version(),
        verdict=verdict,
        sentence=sentence,
        target=processes.info,
        machine=this_machine(),
        settings=_settings(arguments),
        run=run,
        sweep=steps,
        highest_rate=highest,
    )


def _swept(arguments: argparse.Namespace, test: LoadTest, processes: Processes, steps: list[Step]) -> float:
    """Fill `steps`; the highest rate that held."""
    shortest = seconds_of(arguments.step)

    def holds(rate: float) -> bool:
        """Run one step of the sweep, contacts a second, and keep it."""
        seconds = test.long_enough(rate, shortest)
        steps.append(Step(rate, seconds, _run(test, processes, rate, seconds)))
        print_step(steps[-1])
        return steps[-1].summary.verdict is Verdict.HELD

    return highest_held(holds, arguments.rate or DEFAULT_RATE)


def _on_sweep(highest: float, steps: list[Step], run: Summary) -> tuple[Verdict, str]:
    """The verdict on a sweep: that of the long run at the rate found, unless the tool set the limit."""
    broken = min((step for step in steps if step.rate > highest), key=lambda step: step.rate).summary
    if broken.verdict is Verdict.TOOL_TOO_SLOW:
        return broken.verdict, f"above {highest:.4g} contacts/s, {sentence_on(broken)}"
    return run.verdict, f"highest rate found: {highest:.4g} contacts/s; there, {sentence_on(run)}"


def _run(test: LoadTest, processes: Processes, rate: float | None, seconds: float) -> Summary:
    plan = test.plan(rate, seconds)
    title = "as recorded" if rate is None else f"{rate:.4g} contacts/s"
    with progress_of(plan, title) as watch:
        records = processes.run(plan, watch)
    return summarise(plan, records, test.budget)


def _settings(arguments: argparse.Namespace) -> dict[str, Any]:
    given = {name: value for name, value in vars(arguments).items() if name not in NOT_SETTINGS}
    return {name: str(value) if isinstance(value, Path) else value for name, value in given.items()}


def _write(path: Path, content: bytes) -> None:
    try:
        path.write_bytes(content)
    except OSError as error:
        raise FileError(f"expected to write {path.name}, got: {error.strerror}") from error
