"""The console in a real Chromium, in front of the real service; what the browser complains of fails the test."""

import re
import shutil
import signal
from contextlib import contextmanager

import pytest
from playwright.sync_api import expect, sync_playwright

from serving.processes import MODELS, start, stopped_by, until_ready
from shipshape import console

PATIENCE_MS = 30_000
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# The machine may have no graphics card: 3D is drawn by software.
GRAPHICS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
OFFLINE = re.compile(
    r"Failed to load resource"
)  # how the browser itself tells of an answer that is no 2xx, or none


@pytest.fixture(scope="session")
def chromium():
    if not console.built():
        pytest.skip("the console is not built: make console")
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    return CHROMIUM


@pytest.fixture(scope="module")  # no longer: its event loop runs in this thread, and others want one of their own
def browser(chromium):
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=GRAPHICS)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def address(chromium):
    """Where the real service listens, with the default bundle."""
    if not (MODELS / "manifest.toml").is_file():
        pytest.skip("models/ has no manifest.toml yet")
    with start("-m", "shipshape", "serve", SHIPSHAPE_BUNDLE=str(MODELS)) as process:
        rest_port, _ = until_ready(process)
        yield f"http://127.0.0.1:{rest_port}/"
        stopped_by(process, signal.SIGTERM)


@pytest.fixture(scope="module")
def opened(browser):
    """Opens the console at an address, in a browser of its own kind."""

    @contextmanager
    def opened(address, view="bench", **kind):
        complaints = []
        with browser.new_context(**kind) as context:
            page = context.new_page()
            page.set_default_timeout(PATIENCE_MS)
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.on("console", lambda line: complaints.append(line.text) if line.type == "error" else None)
            page.goto(f"{address}#{view}")
            yield page
            assert [line for line in complaints if not OFFLINE.match(line)] == []

    return opened


@pytest.fixture
def bench(opened, address):
    """The bench of the real service, its samples there."""
    with opened(address) as page:
        page.get_by_role("button", name=re.compile("RHIB")).wait_for()
        yield page
