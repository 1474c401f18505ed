"""The site builds without a warning, loads nothing from elsewhere, and its reference is that of the code."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from docs_site.links import rewrite
from docs_site.tables import table

from shipshape.settings import PREFIX, Settings
from shipshape.v1 import shipshape_pb2 as pb

ROOT = Path(__file__).parents[2]


class Loaded(HTMLParser):
    """What a browser would fetch by itself to show a page, and the text that it shows."""

    def __init__(self, page):
        super().__init__()
        self.sources, self.text = [], ""
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        if tag == "link" and attributes.get("rel") not in ("canonical", "next", "prev"):
            self.sources.append(attributes["href"])
        if tag in ("script", "img", "iframe") and "src" in attributes:
            self.sources.append(attributes["src"])

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [Path(sys.executable).with_name("mkdocs"), "build", "--strict", "--site-dir", folder]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    built = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return folder


def test_nothing_is_loaded_from_elsewhere(site):
    pages = {page: Loaded(page) for page in site.rglob("*.html")}
    assert len(pages) > 30
    foreign = {(str(page), source) for page, read in pages.items() for source in read.sources if ":" in source}
    assert {(page, source) for page, source in foreign if not source.startswith("data:")} == set()
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\(\s*['\"]?(?:https?:)?//", sheet.read_text(encoding="utf-8")), sheet


def test_what_a_page_loads_is_there(site):
    for page in site.rglob("*.html"):
        if page.name == "404.html":  # whose addresses hold from the root of a server
            continue
        for source in Loaded(page).sources:
            if not source.startswith("data:"):
                assert (page.parent / source.partition("?")[0]).exists(), (page, source)


def test_every_page_of_docs_is_in_the_navigation(site):
    home = (site / "index.html").read_text(encoding="utf-8")
    for page in (ROOT / "docs").glob("*.md"):
        assert f'href="{page.stem}.html"' in home, page.name


def test_every_setting_is_in_the_reference(site):
    text = Loaded(site / "reference/settings.html").text
    for name, field in Settings.model_fields.items():
        assert f"{PREFIX}{name.upper()}" in text
        assert " ".join(field.description.split()[:6]).replace("`", "") in " ".join(text.split())
    assert "integer, at least 0, at most 65535" in text


def test_the_metrics_are_in_the_reference(site):
    text = Loaded(site / "reference/metrics.html").text
    for name in (
        "shipshape_stage_seconds",
        "shipshape_contacts_total",
        "shipshape_queue_depth",
        "door, method, outcome",
    ):
        assert name.replace(", ", "") in text.replace(", ", ""), name


def test_every_command_is_in_the_reference(site):
    text = Loaded(site / "reference/commands.html").text
    for command in ("serve", "classify", "batch", "check", "bundle verify", "loadtest", "token", "admin swap"):
        assert f"usage: shipshape {command}" in text


def test_every_message_field_and_path_is_in_the_reference(site):
    text = Loaded(site / "reference/grpc.html").text
    for message in pb.DESCRIPTOR.message_types_by_name.values():
        assert message.name in text
        for field in message.fields:
            assert field.name in text, field.full_name
    for enum in pb.DESCRIPTOR.enum_types_by_name.values():
        assert {value.name for value in enum.values} <= set(text.split())
    rest = Loaded(site / "reference/rest.html").text
    assert all(path in rest for path in ("/v1/recognise", "/v1/scan", "/v1/model", "/v1/capacity"))


def test_links_follow_files_to_their_places():
    places = {"docs/api.md": "api.md", "proto/x.proto": "reference/grpc.md", "README.md": "index.md"}
    page = "[a](docs/api.md#errors) [b](proto/x.proto) [c](https://x.example/docs/api.md) [d](#here) [e](other.md)"
    assert rewrite(page, "README.md", "index.md", places.get) == page.replace("docs/api.md#", "api.md#").replace(
        "(proto/x.proto)", "(reference/grpc.md)"
    )
    assert rewrite("[up](../README.md)", "docs/a.md", "adr/a.md", places.get) == "[up](../index.md)"


def test_cells_cannot_break_a_table():
    assert table(["a", "b"], [["x|y", "one\ntwo"]]) == "| a | b |\n| --- | --- |\n| x\\|y | one two |\n"
