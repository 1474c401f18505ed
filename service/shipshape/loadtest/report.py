"""All that one load test found, as it goes into the JSON file and the page."""

import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import orjson

from shipshape.executor import usable_cores
from shipshape.loadtest.budget import LAG_SHARE, Verdict
from shipshape.loadtest.outcomes import Outcome
from shipshape.loadtest.summary import Summary
from shipshape.loadtest.targets.target import TargetInfo


@dataclass(frozen=True, slots=True)
class Machine:
    """Where the tool ran; a target beside it shares these cores."""

    cpu: str
    cores: int  # that this process may use
    system: str
    python: str


@dataclass(frozen=True, slots=True)
class Step:
    """One rate of a sweep, contacts a second."""

    rate: float
    seconds: float
    summary: Summary


@dataclass(frozen=True, slots=True)
class Report:
    """One load test."""

    started: str  # UTC
    tool: str  # version
    verdict: Verdict
    sentence: str
    target: TargetInfo
    machine: Machine
    settings: Mapping[str, Any]  # as on the command line
    run: Summary
    sweep: list[Step]
    highest_rate: float | None  # that held in the sweep, contacts a second; 0 when none did


def this_machine() -> Machine:
    """The machine that this process runs on."""
    return Machine(_cpu(), usable_cores(), platform.platform(), platform.python_version())


def tool_version() -> str:
    """The version of the package."""
    return version("shipshape")


def sentence_on(run: Summary) -> str:
    """The verdict on a run in words."""
    share = run.in_budget / run.requests
    limit_ms = run.budget.limit_s * 1e3
    found = (
        f"{share:.2%} of {run.requests} requests were answered within {limit_ms:g} ms of when they were due, "
        f"{run.budget.share * 100:g}% of them were to be"
    )
    if run.verdict is Verdict.TOOL_TOO_SLOW:
        lag = run.lag.percentiles["p99"] or 0.0
        return (
            f"the tool itself was too slow to tell: it sent with a p99 lag of {lag:.3g} ms, more than "
            f"{limit_ms / LAG_SHARE:g} ms, one part in {LAG_SHARE} of the limit; give it more --processes, or a "
            "machine of its own"
        )
    unsent = run.outcomes[Outcome.UNSENT.label]
    kept_back = f"; {unsent} were never sent, too many others being under way" if unsent else ""
    return f"{run.verdict}: {found}{kept_back}"


def to_json(report: Report) -> bytes:
    """The report as JSON text."""
    return orjson.dumps(report, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or os.uname().machine
