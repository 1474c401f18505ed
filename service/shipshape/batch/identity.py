"""What the rows of a run depend on, beside its inputs."""

import dataclasses
import hashlib
from importlib.metadata import version
from pathlib import Path
from typing import Any

import shipshape
from shipshape.batch import rows
from shipshape.batch.method import Method


def code_digest() -> str:
    """Version of the package and digest of its source: `0.1.0+` and 12 digits of the sha256 of all its files."""
    root = Path(shipshape.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(f"{path.relative_to(root).as_posix()}\0".encode())
        digest.update(path.read_bytes())
    return f"{version('shipshape')}+{digest.hexdigest()[:12]}"


def identity_of(method: Method, bundle: str, code: str) -> dict[str, Any]:
    """As it goes into run.json: one key for each thing that may differ."""
    return {"schema": rows.VERSION, "bundle": bundle, "code": code, **dataclasses.asdict(method)}
