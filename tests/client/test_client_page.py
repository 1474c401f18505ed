"""The examples of docs/client.md run as they stand, against a service; its table of links is that of the code."""

import contextlib
import io
import re
from pathlib import Path

from client.scripted import PATIENCE
from serving.fakes import running
from shipshape.client import LAN, SATELLITE

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/client.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)


def test_every_example_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    printed, names = io.StringIO(), {}
    with running() as doors, contextlib.redirect_stdout(printed):
        for example in EXAMPLES:
            here = example.replace(":50051", f":{doors.addresses.grpc_port}")
            exec(compile(here.replace("timeout_s=2.0", f"timeout_s={PATIENCE}"), "docs/client.md", "exec"), names)
    lines = printed.getvalue().splitlines()
    assert lines[0].startswith("tug 0.75 0.5 ")
    assert sum(line.startswith("('tug', ") for line in lines) == 6
    assert {"0 6", "1 2"} <= set(lines)
    assert sum(line.startswith("grpc://127.0.0.1:") for line in lines) == 3


def test_the_table_of_links_is_that_of_the_code():
    for link in (LAN, SATELLITE):
        for seconds in (link.keepalive_s, link.keepalive_timeout_s, link.longest_backoff_s):
            assert re.search(rf"[ |]{seconds:g} s\b", PAGE), seconds
    assert f"int16 steps of {SATELLITE.step_m * 100:g} cm" in PAGE
