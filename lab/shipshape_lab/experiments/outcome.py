"""What an experiment leaves for the report: OUT/NAME.json with its numbers and what they were computed with."""

import json
from pathlib import Path

from shipshape_lab.commit import code_commit
from shipshape_lab.experiments.numbers import Numbers, rounded


def write(out: Path, name: str, found: Numbers, **about: object) -> Path:
    """Write `found`, to six digits, and `about` with the code's commit; returns the file."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{name}.json"
    content = {"about": {"code": code_commit(), **about}, "numbers": rounded(found)}
    path.write_text(json.dumps(content, indent=1, sort_keys=True, default=str) + "\n")
    return path
