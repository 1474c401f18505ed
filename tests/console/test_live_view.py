"""The live view: its numbers are those of the service, and of the definition of a quantile."""

import re

import httpx
import numpy as np
import pytest
from playwright.sync_api import expect

from serving.fakes import cluster
from shipshape.telemetry import REQUEST_BUCKETS, STAGE_BUCKETS

BUDGET_S = 0.05
ASKED = 25


def test_what_was_asked_is_counted(opened, address):
    with opened(address, "live") as page, httpx.Client(base_url=address, trust_env=False) as client:
        expect(page.locator("#tile-rate")).to_have_text("0 /s")  # two readings, and nothing between them
        for _ in range(ASKED):
            client.post("/v1/recognise", json={"points": cluster().astype(float).tolist()}).raise_for_status()
        page.get_by_role("combobox", name="Over the last").select_option("5 min")
        expect(page.locator("#tile-rate")).not_to_have_text("0 /s")
        model = client.get("/v1/model").json()
        capacity = client.get("/v1/capacity").json()
        rows = page.locator("#stages-rows th")
        assert rows.all_inner_texts() == ["wait for a worker", *(one.replace("_", " ") for one in model["stages"])]
        expect(page.locator("#stages-rows tr").last).to_contain_text(" ms")
        expect(page.locator("#promise-rows tr")).to_have_count(len(capacity["promises"]))
        expect(page.locator("#bundle-facts")).to_contain_text(model["bundle"])
        expect(page.locator("#catalogue tr")).to_have_count(len(model["catalogue"]))
        expect(page.locator("#tile-budget")).not_to_have_text("–")
        expect(page.locator(".chart canvas")).to_have_count(2)


def test_a_capacity_is_asked_for_as_chosen(opened, address):
    with opened(address, "live") as page:
        page.locator("#promise-rows tr").first.wait_for()
        page.get_by_role("spinbutton", name="Points").fill("4000")
        page.get_by_role("combobox", name="Lane").select_option("collision")
        with page.expect_request(re.compile(r"v1/capacity\?points=4000&lane=collision")):
            pass


def exposition(seconds, stage_seconds, refused):
    """What a service writes that answered requests after so many seconds each."""
    bounds = [share * BUDGET_S for share in REQUEST_BUCKETS]
    lines = ["process_start_time_seconds 1.0"]
    lines += _histogram(
        "shipshape_request_seconds", 'door="rest",method="recognise",outcome="ok"', seconds, bounds
    )
    # Neither of these is an answered recognition.
    lines += _histogram("shipshape_request_seconds", 'door="rest",method="capacity",outcome="ok"', [90.0], bounds)
    lines += _histogram(
        "shipshape_request_seconds", 'door="rest",method="recognise",outcome="overloaded"', [1e-4], bounds
    )
    lines += _histogram("shipshape_stage_seconds", 'stage="heading"', stage_seconds, STAGE_BUCKETS)
    lines += [f'shipshape_contacts_total{{door="rest",outcome="ok"}} {len(seconds)}.0']
    lines += [f'shipshape_contacts_total{{door="rest",outcome="overloaded"}} {refused}.0']
    return "\n".join(lines) + "\n"


def _histogram(name, labels, seconds, bounds):
    seconds = np.array(seconds)
    lines = [f'{name}_bucket{{{labels},le="{bound}"}} {(seconds <= bound).sum()}.0' for bound in bounds]
    lines.append(f'{name}_bucket{{{labels},le="+Inf"}} {len(seconds)}.0')
    return [*lines, f"{name}_count{{{labels}}} {len(seconds)}.0", f"{name}_sum{{{labels}}} {seconds.sum()}"]


def by_prometheus(q, seconds, bounds):
    """Its histogram_quantile, milliseconds."""
    edges = [0.0, *bounds]
    counts = [0, *(int((np.array(seconds) <= bound).sum()) for bound in bounds)]
    return float(np.interp(q * len(seconds), counts, edges)) * 1e3


def test_quantiles_are_those_of_the_time_between_two_readings(opened, address):
    rng = np.random.default_rng(3)
    before, between = rng.uniform(0.2, 0.4, 500), rng.gamma(4.0, 0.004, 2000)
    stages = rng.gamma(2.0, 0.0008, 2000)
    readings = iter([exposition(before, [], 7)])
    later = exposition([*before, *between], stages, 7 + 500)

    with opened("about:blank", "") as page:
        page.route("**/metrics", lambda route: route.fulfill(body=next(readings, later)))
        page.goto(f"{address}#live")
        expect(page.locator("#tile-p50")).not_to_have_text(re.compile("nothing|^\\s*$"))
        bounds = [share * BUDGET_S for share in REQUEST_BUCKETS]
        assert shown(page, "#tile-p99") == pytest.approx(by_prometheus(0.99, between, bounds), rel=0.01)
        assert shown(page, "#tile-p50") == pytest.approx(by_prometheus(0.5, between, bounds), rel=0.01)
        cells = page.locator("#stages-rows tr").filter(has_text="heading").locator("td.number").all_inner_texts()
        median, tail, mean = (float(cell.split()[0]) for cell in cells[:3])
        assert median == pytest.approx(by_prometheus(0.5, stages, STAGE_BUCKETS), abs=0.006)
        assert tail == pytest.approx(by_prometheus(0.99, stages, STAGE_BUCKETS), abs=0.006)
        assert mean == pytest.approx(stages.mean() * 1e3, abs=0.006)
        expect(page.locator("#tile-why")).to_contain_text("overloaded")
        answered, refused = shown(page, "#tile-rate"), shown(page, "#tile-refused")
        assert answered / refused == pytest.approx(2000 / 500, rel=0.02)


def shown(page, selector):
    """The number in a tile."""
    return float(re.search(r"[\d.]+", page.locator(selector).inner_text())[0])


def test_nothing_is_asked_while_the_bench_is_shown_but_whether_it_is_there(opened, address):
    with opened(address) as page:
        asked = []
        page.on("request", lambda request: asked.append(request.url))
        for _ in range(2):
            with page.expect_request("**/readyz"):
                pass
        assert not any("metrics" in url or "capacity" in url for url in asked)
