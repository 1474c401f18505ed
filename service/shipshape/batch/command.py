"""The command: find, read, recognise, keep, merge, compare, report."""

import argparse
from collections.abc import Iterator
from pathlib import Path

from shipshape.batch.comparison import compare
from shipshape.batch.engines import Engine
from shipshape.batch.identity import identity_of
from shipshape.batch.inputs import Inputs, find_inputs
from shipshape.batch.merging import merge
from shipshape.batch.method import Method
from shipshape.batch.options import engine_of, method_of
from shipshape.batch.page import to_page
from shipshape.batch.progress import progress_of
from shipshape.batch.report import Report, print_report, report_of, to_json
from shipshape.batch.results import Results, open_results, write_whole
from shipshape.batch.units import Ending, Part, Source
from shipshape.errors import FileError, SettingsError

OK, REFUSED = 0, 1


def batch(arguments: argparse.Namespace) -> int:
    """Recognise all that is in the inputs; 1 when one of them was refused, or not read to its end.

    Raises:
        SettingsError, FileError, BundleError: Nothing can be computed, or kept.
    """
    method = method_of(arguments)
    paths = find_inputs(arguments.inputs, arguments.out)
    if not paths:
        raise FileError("expected files of points or recordings in INPUT, got folders without any")
    if arguments.compare is not None and not (arguments.compare / "contacts.parquet").is_file():
        raise FileError(f"expected results of a finished run in {arguments.compare}, got no contacts.parquet")
    if arguments.compare is not None and arguments.compare.resolve() == arguments.out.resolve():
        raise SettingsError(f"expected another folder in --compare than in --out, got {arguments.out} in both")
    engine = engine_of(arguments, method)  # first: workers fork here, and must inherit neither threads nor locks
    identity = identity_of(method, engine.bundle, engine.code)
    with open_results(arguments.out, identity, clouds=method.restored) as results:
        inputs = Inputs(paths)
        _compute(engine, method, inputs, results)
        report = _reported(arguments.compare, inputs, results, identity)
    print_report(report, arguments.out)
    return REFUSED if any(record.error for record in inputs.records) else OK


def _compute(engine: Engine, method: Method, inputs: Inputs, results: Results) -> None:
    with progress_of(inputs) as tell:

        def unfinished() -> Iterator[Source]:
            """Sources of which something is missing yet."""
            for source in inputs.sources():
                if (ending := results.finished(source.sha256)) is None:
                    yield source
                else:
                    _end(inputs, ending)
                    tell(ending)

        for item in engine.run(unfinished(), method, results.parts):
            if isinstance(item, Part):
                results.add(item)
            else:
                _end(inputs, item)
                results.close(item)
            tell(item)


def _end(inputs: Inputs, ending: Ending) -> None:
    record = inputs.of(ending.sha256)
    record.chunks, record.messages, record.error = ending.chunks, ending.messages, ending.error


def _reported(old: Path | None, inputs: Inputs, results: Results, identity: dict[str, object]) -> Report:
    tally = merge(inputs, results)
    comparison = None if old is None else compare(old, results.folder)
    report = report_of(inputs, tally, identity, comparison)
    write_whole(results.folder / "summary.json", to_json(report))
    write_whole(results.folder / "report.html", to_page(report).encode())
    return report
