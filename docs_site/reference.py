"""Pages made of code: settings, metrics, commands, the REST contract and the client."""

import argparse
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from openapidocs.mk.v3 import OpenAPIV3DocumentationHandler
from prometheus_client import CollectorRegistry

from docs_site import grpc_reference
from docs_site.tables import table
from shipshape.budget import Budget
from shipshape.cli import build_parser
from shipshape.settings import PREFIX, Settings
from shipshape.telemetry import Metrics, watch_workers

CONTRACT = Path(__file__).parents[1] / "openapi.json"
WIDTH = "100"  # columns of a help text
LIMITS = {"minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below"}


def settings() -> str:
    """Every setting, in the order of settings.py."""
    rows = [
        [f"`{PREFIX}{name.upper()}`", _kind(schema), _default(schema), schema.get("description", "")]
        for name, schema in Settings.model_json_schema()["properties"].items()
    ]
    intro = (
        "Each is a variable of the environment; an unknown one, or a value that cannot work, stops the start.\n\n"
    )
    return f"# Settings\n\n{intro}{table(['variable', 'value', 'default', ''], rows)}"


def metrics() -> str:
    """Every metric that `/metrics` shows."""
    registry = CollectorRegistry()
    Metrics(registry, Budget(0.05))
    watch_workers(_NoWorkers(), registry)
    rows = []
    for family in registry.collect():
        collector = registry._names_to_collectors.get(family.name)
        name = f"{family.name}_total" if family.type == "counter" else family.name
        labels = ", ".join(f"`{label}`" for label in getattr(collector, "_labelnames", ()))
        rows.append([f"`{name}`", family.type, labels, family.documentation])
    intro = "At `GET /metrics`, in the text format of Prometheus; seconds, bytes and counts.\n\n"
    return f"# Metrics\n\n{intro}{table(['metric', 'kind', 'labels', ''], sorted(rows))}"


def commands() -> str:
    """What each command says with --help."""
    os.environ["COLUMNS"] = WIDTH
    sections = [f"## {parser.prog}\n\n```text\n{parser.format_help()}```\n" for parser in _parsers(build_parser())]
    return "\n".join(["# Commands\n", *sections])


def rest() -> str:
    """The REST contract."""
    contract = json.loads(CONTRACT.read_text(encoding="utf-8"))
    written = OpenAPIV3DocumentationHandler(contract, style="MARKDOWN", source=str(CONTRACT)).write()
    _, _, below = written.partition("\n# ")  # a notice of its maker, then a title
    below = re.sub(r"^### Response", "#### Response", below.partition("\n")[2], flags=re.M)  # under its path
    return f"# REST\n{below}"


def client() -> str:
    """The Python client."""
    return "# Python client\n\n[How it is used](../client.md).\n\n::: shipshape.client\n"


PAGES: Mapping[str, Callable[[], str]] = {
    "reference/grpc.md": grpc_reference.page,
    "reference/rest.md": rest,
    "reference/client.md": client,
    "reference/settings.md": settings,
    "reference/metrics.md": metrics,
    "reference/commands.md": commands,
}


class _NoWorkers:
    workers = running = queue_depth = 0
    queue_age = 0.0


def _parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for child in action.choices.values():
                yield from _parsers(child)


def _kind(schema: Mapping[str, Any]) -> str:
    if "anyOf" in schema:
        return " or none".join(
            [" or ".join(_kind(each) for each in schema["anyOf"] if each["type"] != "null"), ""]
        )
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    limits = [f"{words} {schema[key]:g}" for key, words in LIMITS.items() if key in schema]
    return ", ".join([schema.get("format") or schema["type"], *limits])


def _default(schema: Mapping[str, Any]) -> str:
    if "default" not in schema:
        return "see there"
    return "none" if schema["default"] is None else f"`{schema['default']}`"
