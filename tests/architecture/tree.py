"""The checkout's own files, for tests about the source rather than about what it does."""

import ast
import subprocess
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
GENERATED = {ROOT / "service/shipshape/v1", ROOT / "service/shipshape/inference"}


def tracked(pattern: str = "*") -> list[Path]:
    """Files under version control whose path fits the pattern, and that are there."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--", pattern], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    return [path for name in listed.split("\0") if name and (path := ROOT / name).is_file()]


def sources() -> list[Path]:
    """Hand-written Python files."""
    return [path for path in tracked("*.py") if GENERATED.isdisjoint(path.parents)]


def functions(path: Path) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Every function and method of a file, nested ones too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


def name(path: Path) -> str:
    """The path as it is written in the checkout."""
    return path.relative_to(ROOT).as_posix()
