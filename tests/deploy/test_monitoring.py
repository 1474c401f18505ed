"""The real Prometheus, with the rules and the dashboard of deploy/, against a real service under real traffic."""

import ast
import json
import re
import shutil
import subprocess
import sys
import time
from typing import NamedTuple

import httpx
import pytest
import yaml

from architecture.tree import ROOT
from deploy.free import free_port
from serving.fakes import PATIENCE
from serving.processes import MODELS, START_PATIENCE, start, until_ready

DEPLOY = ROOT / "deploy"
DASHBOARD = json.loads((DEPLOY / "grafana/dashboards/shipshape.json").read_text())
RULES = [
    rule
    for file in ("recording.yml", "alerts.yml")
    for group in yaml.safe_load((DEPLOY / "prometheus" / file).read_text())["groups"]
    for rule in group["rules"]
]
PROMTOOL, PROMETHEUS = shutil.which("promtool"), shutil.which("prometheus")
needs_promtool = pytest.mark.skipif(PROMTOOL is None, reason="promtool is not installed")
VARIABLES = {"$job": ".*", "$instance": ".*", "$__rate_interval": "1m"}


def queries():
    """Each query of the dashboard with the title of its panel."""
    panels = [panel for panel in DASHBOARD["panels"] if panel["type"] != "row"]
    return [(panel["title"], target["expr"]) for panel in panels for target in panel["targets"]]


def promtool(*arguments, **more):
    return subprocess.run([PROMTOOL, *arguments], capture_output=True, text=True, check=False, **more)


@needs_promtool
def test_promtool_takes_config_and_rules():
    checked = promtool("check", "config", str(DEPLOY / "prometheus/prometheus.yml"))
    assert checked.returncode == 0, checked.stdout + checked.stderr


@needs_promtool
def test_each_alert_wakes_somebody_when_it_must_and_nobody_when_all_is_well():
    file = ROOT / "tests/deploy/alerts_test.yml"
    tested = promtool("test", "rules", str(file))
    assert tested.returncode == 0, tested.stdout + tested.stderr
    named = set(re.findall(r"alertname: (\w+)", file.read_text()))
    assert named == {rule["alert"] for rule in RULES if "alert" in rule}


def test_each_alert_says_what_is_wrong_and_has_its_line_in_the_page():
    page = (ROOT / "docs/deploy.md").read_text(encoding="utf-8")
    for rule in (rule for rule in RULES if "alert" in rule):
        assert rule["annotations"]["summary"]
        assert rule["labels"]["severity"] in ("critical", "warning")
        assert f"`{rule['alert']}`" in page


def test_the_dashboard_asks_the_provisioned_source():
    (source,) = yaml.safe_load((DEPLOY / "grafana/provisioning/datasources/prometheus.yml").read_text())[
        "datasources"
    ]
    variables = {variable["name"]: variable for variable in DASHBOARD["templating"]["list"]}
    assert variables["datasource"]["current"]["value"] == source["uid"]
    asked = [panel["datasource"]["uid"] for panel in DASHBOARD["panels"] if panel["type"] != "row"]
    assert set(asked) == {"${datasource}"}
    ids = [panel["id"] for panel in DASHBOARD["panels"]]
    assert len(set(ids)) == len(ids)


def test_no_panel_lies_on_another():
    cells = [
        (x, y)
        for spot in (panel["gridPos"] for panel in DASHBOARD["panels"])
        for x in range(spot["x"], spot["x"] + spot["w"])
        for y in range(spot["y"], spot["y"] + spot["h"])
    ]
    assert len(set(cells)) == len(cells)
    assert max(x for x, _ in cells) < 24


class Ports(NamedTuple):
    """Of a service under traffic."""

    health: int
    grpc: int


def traffic(grpc_port, *more):
    return [sys.executable, ROOT / "examples/traffic.py", f"127.0.0.1:{grpc_port}", "--hz", "2", *more]


@pytest.fixture(scope="module")
def service():
    if not (MODELS / "manifest.toml").is_file():
        pytest.skip("models/ has no manifest.toml yet")
    port = free_port()
    process = start("-m", "shipshape", "serve", SHIPSHAPE_HEALTH_PORT=str(port))
    try:
        _, grpc_port = until_ready(process)
        with subprocess.Popen(traffic(grpc_port), stdout=subprocess.DEVNULL) as playing:
            yield Ports(port, grpc_port)
            playing.terminate()
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def prometheus(service, tmp_path_factory):
    """An API of the real one, with the tracked rules, which scrapes the service each second."""
    if PROMETHEUS is None:
        pytest.skip("prometheus is not installed")
    folder = tmp_path_factory.mktemp("prometheus")
    shutil.copytree(DEPLOY / "prometheus", folder, dirs_exist_ok=True)
    config = yaml.safe_load((folder / "prometheus.yml").read_text())
    config["global"] = {"scrape_interval": "1s", "evaluation_interval": "1s"}
    (scraped,) = config["scrape_configs"]
    del scraped["dns_sd_configs"]  # there is no name server here
    scraped["static_configs"] = [{"targets": [f"127.0.0.1:{service.health}"]}]
    (folder / "prometheus.yml").write_text(yaml.safe_dump(config))
    port = free_port()
    command = [PROMETHEUS, "--config.file=prometheus.yml", f"--web.listen-address=127.0.0.1:{port}"]
    with (
        subprocess.Popen(command, cwd=folder, stderr=subprocess.DEVNULL) as process,
        httpx.Client(base_url=f"http://127.0.0.1:{port}/api/v1", trust_env=False, timeout=PATIENCE) as api,
    ):
        try:
            until_answers(api)
            yield api
        finally:
            process.terminate()


def until_answers(api):
    """It reads its rules and its store first."""
    end = time.monotonic() + START_PATIENCE
    while time.monotonic() < end:
        try:
            if api.get("/status/runtimeinfo").status_code == httpx.codes.OK:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.2)
    pytest.fail("Prometheus did not start")


def values(api, query):
    """What a query returns now, without what is not a number."""
    for name, value in VARIABLES.items():
        query = query.replace(name, value)
    answer = api.get("/query", params={"query": query}).json()
    assert answer["status"] == "success", f"{query}: {answer}"
    return [sample["value"][1] for sample in answer["data"]["result"] if sample["value"][1] != "NaN"]


def still_empty(api, asked):
    """Of the named queries, those that have returned nothing by the end of our patience."""
    asked, end = list(asked), time.monotonic() + START_PATIENCE
    while (empty := {name: query for name, query in asked if not values(api, query)}) and time.monotonic() < end:
        asked = list(empty.items())
        time.sleep(0.5)
    return empty


def test_the_traffic_of_the_demo_is_answered(service):
    played = subprocess.run(traffic(service.grpc, "--seconds", "3"), capture_output=True, text=True, check=False)
    assert played.returncode == 0, played.stderr
    seen = ast.literal_eval(played.stdout.splitlines()[-1])
    assert seen["ok"] > 0
    assert sum(seen.values()) % 6 == 0  # whole scans


def test_promtool_takes_the_metrics_of_the_service(service):
    if PROMTOOL is None:
        pytest.skip("promtool is not installed")
    metrics = httpx.get(f"http://127.0.0.1:{service.health}/metrics", trust_env=False).text
    checked = promtool("check", "metrics", input=metrics)
    complaints = [
        line for line in checked.stderr.splitlines() if line.startswith("shipshape") and "_created" not in line
    ]
    assert complaints == []


def test_every_query_of_the_dashboard_returns_data(prometheus):
    asked = [(f"{title}: {query}", query) for title, query in queries()]
    assert still_empty(prometheus, asked) == {}


def test_every_recording_rule_returns_data(prometheus):
    assert still_empty(prometheus, [(rule["record"],) * 2 for rule in RULES if "record" in rule]) == {}


def test_alerts_ask_for_what_the_service_exports(prometheus):
    names = {name for rule in RULES for name in re.findall(r"(?:job:)?shipshape\w[\w:]*|up\b", rule["expr"])}
    assert still_empty(prometheus, [(name, name) for name in names]) == {}


def test_every_rule_is_evaluated_and_no_alert_fires_for_a_service_that_is_well(prometheus):
    assert still_empty(prometheus, [("rules were evaluated", "job:shipshape_load:ratio")]) == {}
    groups = prometheus.get("/rules").json()["data"]["groups"]
    rules = [rule for group in groups for rule in group["rules"]]
    assert len(rules) == len(RULES)
    assert [rule["name"] for rule in rules if rule["health"] == "err"] == []
    assert [rule["name"] for rule in rules if rule.get("state") == "firing"] == []
