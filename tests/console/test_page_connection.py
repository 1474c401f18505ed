"""What the page says when the service is gone, is not ready, or asks for a token."""

import re
import signal
from contextlib import contextmanager

import pytest
from playwright.sync_api import expect

from serving.fakes import running
from serving.processes import SERVE_FAKES, start, stopped_by, until_ready
from shipshape.serving.tokens import hash_of

TOKEN = "a-token-for-the-tests"


def state(page, said):
    expect(page.locator("#state")).to_have_text(said)


def test_a_lost_connection_is_shown_and_comes_back(opened):
    with start("-c", SERVE_FAKES) as process, start_page(opened, process) as (page, port):
        state(page, "Ready")
        sample = page.get_by_role("button", name=re.compile("RHIB"), include_hidden=True)
        expect(sample).to_be_attached()  # it has come from the service, which is about to go
        stopped_by(process, signal.SIGTERM)
        lost = page.get_by_role("alert").filter(has_text="No connection to the service since")
        expect(lost).to_be_visible()
        state(page, "No connection")
        page.get_by_role("link", name="Bench").click()
        sample.click()
        expect(page.locator("#problem")).to_contain_text("expected an answer from the service, got none")
        with start("-c", SERVE_FAKES, SHIPSHAPE_REST_PORT=str(port)) as again:
            until_ready(again)
            expect(lost).to_be_hidden()
            state(page, "Ready")
            expect(page.locator("#problem")).to_be_hidden()
            stopped_by(again, signal.SIGTERM)


def test_samples_that_were_missed_come_with_the_connection(opened, browser):
    with running() as doors, opened(f"http://127.0.0.1:{doors.addresses.rest_port}/", "bench") as page:
        page.route("**/samples.json", lambda route: route.abort())
        page.reload()
        expect(page.locator("#problem")).to_contain_text("expected an answer from the service, got none")
        page.unroute("**/samples.json")
        page.route("**/readyz", lambda route: route.abort())
        state(page, "No connection")
        page.unroute("**/readyz")
        state(page, "Ready")
        expect(page.get_by_role("button", name=re.compile("RHIB"))).to_be_visible()
        expect(page.locator("#problem")).to_be_hidden()


@contextmanager
def start_page(opened, process):
    """The live view of a service that has just been started, and the port it got."""
    port, _ = until_ready(process)
    with opened(f"http://127.0.0.1:{port}/", "live") as page:
        yield page, port


@pytest.fixture
def locked(tmp_path, browser):
    (tmp_path / "tokens").write_text(f"bridge {hash_of(TOKEN)}\n")
    (tmp_path / "tokens").chmod(0o600)
    with running(tokens_file=tmp_path / "tokens") as doors:
        yield f"http://127.0.0.1:{doors.addresses.rest_port}/"


def test_a_token_is_asked_for_and_kept_in_memory_alone(opened, locked):
    with opened(locked, "live") as page:
        asking = page.get_by_role("dialog", name="This service asks for a token")
        field = asking.get_by_label("Token")
        expect(field).to_be_focused()
        field.fill("wrong")
        field.press("Enter")
        expect(asking).to_contain_text("expected a token that this service knows, got another")
        field.fill(TOKEN)
        field.press("Enter")
        expect(page.locator("#tile-rate")).to_have_text("0 /s")
        expect(asking).to_be_hidden()
        page.get_by_role("link", name="Bench").click()
        page.get_by_role("button", name=re.compile("RHIB")).click()
        expect(page.locator("#curl")).to_contain_text('-H "Authorization: Bearer $TOKEN"')
        kept = page.evaluate("[JSON.stringify(localStorage), JSON.stringify(sessionStorage), document.cookie]")
        assert TOKEN not in "".join(kept) + page.content()
        page.reload()
        expect(field).to_be_focused()


def test_who_gives_no_token_is_asked_again_only_when_wanted(opened, locked):
    with opened(locked, "live") as page:
        asking = page.get_by_role("dialog")
        expect(asking).to_be_visible()
        page.keyboard.press("Escape")
        expect(asking).to_be_hidden()
        state(page, "Token needed")
        page.get_by_role("button", name="Give a token").click()
        expect(asking).to_be_visible()


def test_a_service_that_is_not_ready_says_what_it_is(opened, browser):
    with running(opened=False) as doors, opened(f"http://127.0.0.1:{doors.addresses.rest_port}/", "live") as page:
        expect(page.locator("#state")).to_have_text(re.compile("Starting|Warming"))
        expect(page.locator("#lost")).to_be_hidden()
