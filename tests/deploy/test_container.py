"""Dockerfile, docker-compose.yml and the scripts beside them; `deploy/prove_image.sh` builds and runs it all."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from architecture.tree import ROOT, tracked
from shipshape.settings import PREFIX, Settings

TOOLS = Path(sys.executable).parent
DOCKERFILE = (ROOT / "Dockerfile").read_text()
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
SETTINGS = {f"{PREFIX}{name}".upper() for name in Settings.model_fields}
EXIT_S = 3.0  # docs/operations.md: what a stop takes beside linger and drain


def ran(*command):
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.skipif(not (TOOLS / "hadolint").exists(), reason="hadolint is not installed")
def test_hadolint_has_nothing_to_say():
    linted = ran(TOOLS / "hadolint", "Dockerfile")
    assert linted.returncode == 0, linted.stdout


def test_the_compose_file_is_of_its_schema():
    checked = ran(TOOLS / "check-jsonschema", "--builtin-schema", "vendor.compose-spec", "docker-compose.yml")
    assert checked.returncode == 0, checked.stdout


def test_yaml_is_tidy():
    files = [str(path) for path in tracked("*.yml") + tracked("*.yaml") if "tests" not in path.parts]
    assert len(files) > 10
    linted = ran(TOOLS / "yamllint", "--strict", *files)
    assert linted.returncode == 0, linted.stdout


def test_shell_scripts_parse():
    for script in tracked("deploy/*.sh"):
        assert ran("sh", "-n", str(script)).returncode == 0


def test_the_image_sets_only_settings_that_there_are():
    named = set(re.findall(r"\bSHIPSHAPE_\w+(?==)", DOCKERFILE)) | set(
        COMPOSE["services"]["shipshape"]["environment"]
    )
    assert len(named) >= 7
    assert named <= SETTINGS


def test_what_the_image_copies_is_not_ignored():
    copied = re.findall(r"^COPY (?!--from)(?:--\S+ )?(.+) \S+$", DOCKERFILE, re.M)
    kept = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    assert {name for names in copied for name in names.split()} == kept
    assert all((ROOT / name).exists() for name in kept)


def test_the_image_holds_the_console_of_its_own_sources():
    built, installed = "service/shipshape/console/static", "install --no-build-isolation"
    copied = f"COPY --from=console /src/{built} {built}\n"
    assert DOCKERFILE.index("/console/build.sh") < DOCKERFILE.index(copied) < DOCKERFILE.index(installed)
    assert built in (ROOT / "pyproject.toml").read_text()
    assert "**/node_modules" in (ROOT / ".dockerignore").read_text()


def test_both_stages_compile_for_the_same_processor():
    for setting in ("ARG NUMBA_CPU_NAME=generic", "NUMBA_CPU_NAME=${NUMBA_CPU_NAME}", 'NUMBA_CPU_FEATURES=""'):
        assert DOCKERFILE.count(setting) == 2, setting


def test_no_container_of_the_compose_file_has_more_rights_than_it_needs():
    for name, service in COMPOSE["services"].items():
        assert service["read_only"], name
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert all(port.startswith("127.0.0.1:") for port in service.get("ports", [])), name


def test_docker_waits_until_the_service_has_drained():
    service = COMPOSE["services"]["shipshape"]
    needed = sum(float(service["environment"][f"{PREFIX}{name}"]) for name in ("LINGER_S", "DRAIN_S"))
    assert float(service["stop_grace_period"].removesuffix("s")) > needed + EXIT_S


def test_what_compose_mounts_is_there():
    mounts = [mount for service in COMPOSE["services"].values() for mount in service.get("volumes", [])]
    folders = [mount.partition(":")[0] for mount in mounts if mount.startswith("./")]
    assert folders
    assert all((ROOT / folder).is_dir() for folder in folders)


def test_grafana_looks_where_compose_mounts():
    grafana = COMPOSE["services"]["grafana"]
    mounted = {mount.split(":")[1]: mount.split(":")[0] for mount in grafana["volumes"]}
    provisioned = ROOT / "deploy/grafana/provisioning"
    (provider,) = yaml.safe_load((provisioned / "dashboards/shipshape.yml").read_text())["providers"]
    dashboards = ROOT / mounted[provider["options"]["path"]]
    home = Path(grafana["environment"]["GF_DASHBOARDS_DEFAULT_HOME_DASHBOARD_PATH"])
    assert (dashboards / home.name).is_file()
    assert str(home.parent) == provider["options"]["path"]
    (source,) = yaml.safe_load((provisioned / "datasources/prometheus.yml").read_text())["datasources"]
    host, port = re.fullmatch(r"http://(\w+):(\d+)", source["url"]).groups()
    assert any(published.endswith(f":{port}") for published in COMPOSE["services"][host]["ports"])


def test_prometheus_scrapes_the_health_port_of_the_service():
    config = yaml.safe_load((ROOT / "deploy/prometheus/prometheus.yml").read_text())
    (found,) = config["scrape_configs"][0]["dns_sd_configs"]
    assert set(found["names"]) <= set(COMPOSE["services"])
    assert f"SHIPSHAPE_HEALTH_PORT={found['port']}" in DOCKERFILE
