"""All that one run found, as it goes into summary.json, onto the page and onto the terminal."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson
from rich.console import Console
from rich.table import Table

from shipshape.batch.comparison import Comparison
from shipshape.batch.inputs import InputRecord, Inputs
from shipshape.batch.summary import MS_EDGES, PROBABILITY_EDGES, Tally

WIDTH = 100  # of a line that goes into a file
PERCENTILES = (50, 90, 99)
SHOWN = 10  # inputs with a complaint, and flips, on a terminal


@dataclass(frozen=True, slots=True)
class Report:
    """One run."""

    run: dict[str, Any]  # bundle, code and options
    inputs: list[InputRecord]
    contacts: int
    answered: int
    refused: int
    vessels: dict[str, int]  # contacts by what they are called, most first
    reasons: dict[str, int]  # why to trust answers less
    refusals: dict[str, int]  # by what was expected
    probability: list[tuple[float, float, int]]  # from, to, contacts
    ms: list[tuple[float, float, int]]  # milliseconds of all stages: from, to, contacts
    ms_percentiles: dict[str, float | None]
    stage_ms: dict[str, float]  # mean of a contact
    comparison: Comparison | None


def report_of(inputs: Inputs, tally: Tally, run: dict[str, Any], comparison: Comparison | None) -> Report:
    """The report on a run."""
    return Report(
        run=run,
        inputs=inputs.records,
        contacts=tally.contacts,
        answered=tally.answered,
        refused=tally.refused,
        vessels=dict(tally.vessels.most_common()),
        reasons=dict(tally.reasons.most_common()),
        refusals=dict(tally.refusals.most_common()),
        probability=_histogram(PROBABILITY_EDGES, tally.probability),
        ms=_histogram(MS_EDGES, tally.ms),
        ms_percentiles={f"p{percent}": tally.percentile_ms(percent) for percent in PERCENTILES},
        stage_ms={stage: total / max(tally.answered, 1) for stage, total in tally.stage_ms.items()},
        comparison=comparison,
    )


def to_json(report: Report) -> bytes:
    """The report as JSON text."""
    return orjson.dumps(report, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)


def print_report(report: Report, out: Path) -> None:
    """For a terminal or a log: what was found, and last where the rest of it is."""
    console = Console()
    console = console if console.is_terminal else Console(width=WIDTH)
    console.print(_counts(report))
    if report.comparison is not None:
        console.print(_changes(report.comparison))
    bad = [record for record in report.inputs if record.error]
    for record in bad[:SHOWN]:
        console.print(f"{record.name}: {record.error}", markup=False, highlight=False, soft_wrap=True)
    if len(bad) > SHOWN:
        console.print(f"and {len(bad) - SHOWN} more inputs, listed in the report")
    console.print(f"{out}/contacts.parquet, {out}/report.html", markup=False, highlight=False, soft_wrap=True)


def _counts(report: Report) -> Table:
    table = Table("contacts", "", "", box=None, pad_edge=False)
    for name, count in report.vessels.items():
        table.add_row(name, str(count), f"{count / report.contacts:.1%}")
    for name, count in report.refusals.items():
        table.add_row("refused", str(count), f"{count / report.contacts:.1%}  {name}")
    read = sum(not record.error and not record.same_as for record in report.inputs)
    table.add_row("together", str(report.contacts), f"in {read} of {len(report.inputs)} inputs")
    return table


def _changes(comparison: Comparison) -> Table:
    table = Table("changes", "contacts", "", box=None, pad_edge=False)
    table.add_row("in both", str(comparison.both), f"only old {comparison.only_old}, new {comparison.only_new}")
    for flip in comparison.flips[:SHOWN]:
        table.add_row("called", str(flip.contacts), f"{flip.old} -> {flip.new}")
    table.add_row("bow changed ends", str(comparison.turned), "")
    shifts = {"probability": comparison.probability_shift, "heading, deg": comparison.heading_shift_deg}
    for name, shift in shifts.items():
        table.add_row(name, "", "  ".join(f"{percent} {value:+.3f}" for percent, value in shift.items()))
    table.add_row("changed rows", str(comparison.changed), "changes.parquet")
    return table


def _histogram(edges: Any, counts: Any) -> list[tuple[float, float, int]]:
    return [
        (float(low), float(high), int(count))
        for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True)
    ]
