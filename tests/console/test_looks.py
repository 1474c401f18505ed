"""Dark and light, phone to desktop, with the keyboard alone, and for those who listen."""

import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

AXE = Path(__file__).parents[2] / "console/node_modules/axe-core/axe.min.js"
VIEWS = ("live", "bench")
PHONE, TABLET, DESKTOP = (
    {"width": 360, "height": 740},
    {"width": 820, "height": 1100},
    {"width": 1440, "height": 900},
)


def fill(page, view):
    """Wait until the view has all that it shows."""
    if view == "live":
        expect(page.locator("#tile-rate")).to_have_text(re.compile("/s"))
        page.locator("#stages-rows tr").first.wait_for()
    else:
        page.get_by_role("button", name=re.compile("RHIB")).click()
        page.locator("#results:not([hidden]):not(.old)").wait_for()


def ground(page):
    """How bright the page is, 0 to 255."""
    colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
    return np.mean([int(number) for number in re.findall(r"\d+", colour)[:3]])


def test_the_colours_follow_the_system_until_the_user_chooses(opened, address):
    with opened(address, color_scheme="light") as page:
        assert ground(page) > 200
        page.emulate_media(color_scheme="dark")
        expect(page.locator("html")).to_have_attribute("data-theme", "dark")
        assert ground(page) < 60
        page.get_by_label("Colours").select_option("Light")
        assert ground(page) > 200
        page.reload()
        assert ground(page) > 200  # remembered
        page.get_by_label("Colours").select_option("System")
        assert ground(page) < 60


@pytest.mark.parametrize("size", [PHONE, TABLET, DESKTOP], ids=["phone", "tablet", "desktop"])
@pytest.mark.parametrize("view", VIEWS)
def test_nothing_is_wider_than_the_screen(opened, address, view, size):
    with opened(address, view, viewport=size) as page:
        fill(page, view)
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
        outside = """() => [...document.querySelectorAll('main *')].filter(one => {
            const box = one.getBoundingClientRect();
            return box.width > 0 && box.right > innerWidth + 1 && !one.closest('.scroll, pre, .hidden');
        }).map(one => one.outerHTML.slice(0, 80))"""
        assert page.evaluate(outside) == []


def test_on_a_phone_the_answer_comes_into_sight(opened, address):
    with opened(address, viewport=PHONE) as page:
        expect(page.locator("#verdict")).not_to_be_in_viewport()
        fill(page, "bench")
        expect(page.locator("#verdict")).to_be_in_viewport()


@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed: make console")
@pytest.mark.parametrize("scheme", ["dark", "light"])
@pytest.mark.parametrize("view", VIEWS)
def test_no_rule_of_accessibility_is_broken(opened, address, view, scheme):
    # axe is injected by the test, which the page's own policy would not let in.
    with opened(address, view, color_scheme=scheme, bypass_csp=True) as page:
        fill(page, view)
        page.add_script_tag(path=AXE)
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")["violations"]
        assert [(one["id"], one["impact"], [node["html"][:90] for node in one["nodes"]]) for one in found] == []


def test_the_keyboard_is_enough(opened, address):
    with opened(address, "live") as page:
        press(page, "Tab", until="Skip to the content")
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") == "main"
        press(page, "Shift+Tab", until="Bench")
        page.keyboard.press("Enter")
        expect(page.get_by_role("heading", name="Bench")).to_be_visible()
        expect(page.get_by_role("button", name=re.compile("RHIB"))).to_be_visible()
        press(page, "Tab", until="RHIB", at=re.match)
        assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
        page.keyboard.press("Enter")
        page.locator("#results:not([hidden]):not(.old)").wait_for()
        press(page, "Tab", until="Contact in 3D", at=re.match)
        for key in ("ArrowLeft", "ArrowUp", "+", "Shift+ArrowRight"):
            before = page.locator("#scene canvas").screenshot()
            page.keyboard.press(key)
            seen = (page.locator("#scene canvas").screenshot() for _ in range(100))  # it is drawn a moment later
            assert any(shot != before for shot in seen), key
        press(page, "Tab", until="layer-raw")
        page.keyboard.press("Space")
        expect(page.get_by_role("checkbox", name="Raw cluster")).not_to_be_checked()


def press(page, key, until, at=re.fullmatch):
    """Presses a key until what has the focus is called so."""
    named = "one => one.getAttribute('aria-label') || one.innerText.trim() || one.id"
    passed = []
    for _ in range(60):
        page.keyboard.press(key)
        passed.append(page.evaluate(f"({named})(document.activeElement)"))
        if at(until, passed[-1]):
            return
    pytest.fail(f"{until} was never reached, only {passed}")
