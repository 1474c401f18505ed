"""What the REST door serves of the console, without a browser."""

import re
from html.parser import HTMLParser

import pytest

from serving.fakes import doors, running
from shipshape import console

__all__ = ["doors"]

needs_build = pytest.mark.skipif(not console.built(), reason="the console is not built: make console")
INLINE = {"style", "onclick", "onload", "onerror", "onsubmit", "onchange", "onkeydown"}


class Tags(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))


@needs_build
def test_the_page_allows_nothing_but_what_its_service_serves(doors):
    page = doors.rest.get("/")
    assert page.status_code == 200
    assert page.headers["content-type"].startswith("text/html")
    policy = dict(part.split(" ", 1) for part in page.headers["content-security-policy"].split("; "))
    assert policy.pop("default-src") == policy.pop("frame-ancestors") == "'none'"
    assert set(policy.values()) == {"'self'", "'none'"}
    assert page.headers["x-content-type-options"] == "nosniff"


@needs_build
def test_the_page_has_no_script_or_style_of_its_own_and_loads_nothing_from_elsewhere(doors):
    text = doors.rest.get("/").text
    assert re.findall(r"<script[^>]*>(?!</script>)|<style", text) == []
    for tag, attributes in Tags(text).found:
        assert INLINE.isdisjoint(attributes), tag
        wanted = attributes.get("src") or (attributes.get("href") if tag == "link" else None)
        if wanted:
            assert doors.rest.get(f"/{wanted}").status_code == 200, wanted


@needs_build
def test_files_are_asked_for_again_and_sent_again_only_when_they_changed(doors):
    first = doors.rest.get("/console/main.js")
    assert first.headers["cache-control"] == "no-cache"
    assert "content-security-policy" in first.headers
    again = doors.rest.get("/console/main.js", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


@needs_build
@pytest.mark.parametrize("path", ["/console/nothing.js", "/console/%2e%2e/__init__.py", "/console//etc/passwd"])
def test_what_is_no_file_of_the_console_is_not_found(doors, path):
    missing = doors.rest.get(path)
    assert missing.status_code == 404
    assert missing.headers["content-type"] == "application/problem+json"


@needs_build
def test_the_licences_of_what_it_bundles_come_with_it(doors):
    text = doors.rest.get("/console/licences.txt").text
    assert {"fflate", "three", "uplot"} <= set(re.findall(r"^(\S+) \d+\.\d+\.\d+$", text, re.M))


def test_without_a_build_the_page_says_so(monkeypatch):
    monkeypatch.setattr(console, "built", lambda: None)
    with running() as doors:
        missing = doors.rest.get("/")
        assert doors.rest.get("/console/main.js").status_code == 404
    assert missing.status_code == 404
    assert missing.json()["detail"].startswith("expected the console in this installation, got one without it")
