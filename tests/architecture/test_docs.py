import ast
import re
import shlex

import pytest

from architecture.tree import GENERATED, ROOT, functions, name, sources, tracked
from shipshape.cli import build_parser

DOCUMENTS = [path for path in tracked("*.md") if GENERATED.isdisjoint(path.parents)]
ARCHITECTURE = ROOT / "ARCHITECTURE.md"


def test_the_stage_table_is_the_pipelines():
    rows = re.findall(r"^\| `(\w+)` \|.*`(service/shipshape/stages/\w+\.py)` \|$", ARCHITECTURE.read_text(), re.M)
    assert [stage for stage, _ in rows] == _stages()
    assert [file for _, file in rows] == [f"service/shipshape/stages/{stage}.py" for stage in _stages()]


@pytest.mark.parametrize("document", DOCUMENTS, ids=name)
def test_links_lead_somewhere(document):
    links = re.findall(r"\]\((?!\w+:|#)([^)#\s]+)", document.read_text(encoding="utf-8"))
    assert [link for link in links if not (document.parent / link).exists()] == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=name)
def test_files_that_are_named_are_there(document):
    named = re.findall(
        r"`((?:service|lab|tests|docs|proto|requirements|examples|benchmarks)/[\w./-]+)`", document.read_text()
    )
    assert [file for file in named if not (ROOT / file).exists()] == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=name)
def test_make_commands_that_are_named_are_there(document):
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
    named = set(re.findall(r"(?:`|^ *)make ([a-z-]+)", document.read_text(encoding="utf-8"), re.M))
    assert named <= targets


@pytest.mark.parametrize("document", DOCUMENTS, ids=name)
def test_shipshape_commands_that_are_shown_parse(document):
    for line in re.findall(r"^(?:\.venv/bin/)?shipshape (.+)$", document.read_text(encoding="utf-8"), re.M):
        build_parser().parse_args(shlex.split(line, comments=True))


def test_decisions_are_numbered_without_gaps_and_say_what_was_given_up():
    decisions = sorted((ROOT / "docs/adr").glob("*.md"))
    assert [int(path.name[:4]) for path in decisions] == list(range(1, len(decisions) + 1))
    for path in decisions:
        leads = re.findall(r"^\*\*([\w ]+)\.\*\*", path.read_text(encoding="utf-8"), re.M)
        assert [lead for lead in leads if lead != "Measured"] == ["Context", "Decision", "Given up"], path.name


def test_every_public_function_of_the_service_says_what_it_does():
    silent = [
        f"{name(path)}:{function.lineno} {function.name}"
        for path in sources()
        if ROOT / "service" in path.parents
        for function in _public(path)
        if not ast.get_docstring(function)
    ]
    assert silent == []


def _public(path):
    found = list(functions(path))
    inner = {id(nested) for outer in found for nested in ast.walk(outer) if nested is not outer}
    return [function for function in found if not function.name.startswith("_") and id(function) not in inner]


def _stages():
    tree = ast.parse((ROOT / "service/shipshape/pipeline.py").read_text(encoding="utf-8"))
    calls = [
        node for node in ast.walk(tree) if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Stage"
    ]
    names = [call.args[0].value for call in sorted(calls, key=lambda call: call.lineno)]
    return list(dict.fromkeys(names))  # lower rungs of the ladder name some again
