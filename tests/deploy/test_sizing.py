"""The arithmetic of docs/deploy.md, by hand and against the page, and the one place of the numbers of a pod."""

import json
import re
import runpy
import shlex
import subprocess
import sys

import pytest
import yaml

from architecture.tree import ROOT

SCRIPT = ROOT / "deploy/sizing.py"
SIZING = runpy.run_path(str(SCRIPT))


def test_a_load_worked_out_by_hand():
    # 4,200 contacts a second / (300 x 0.7) = 20 cores = 10 pods, and one in ten more
    of = SIZING["size"](4200.0, 300.0)
    assert (of.cores, of.pods) == (pytest.approx(20.0), 11)
    assert of.memory_gib == 11.0
    assert of.inbound_mbit == pytest.approx(4200 * 3700 * 8 / 1e6)


def test_one_boat_still_has_a_pod_to_spare():
    assert SIZING["size"](1.0, 300.0).pods == 2


def test_the_table_of_the_page_is_what_its_command_prints():
    page = (ROOT / "docs/deploy.md").read_text(encoding="utf-8")
    command, table = re.search(r"^python (deploy/sizing\.py .*)\n```\n\n((?:\|.*\n)+)", page, re.M).groups()
    ran = subprocess.run(
        [sys.executable, *shlex.split(command)], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert ran.stdout == table


def test_what_was_measured_is_taken_a_core(tmp_path):
    results = tmp_path / "serving.json"
    results.write_text(
        json.dumps({"throughput.grpc_scan8": 700.0, "about.cores": "2 for the server, 2 for the load"})
    )
    assert SIZING["measured"](results) == 350.0
    results.write_text("{}")
    with pytest.raises(ValueError, match="--per-core"):
        SIZING["measured"](results)


def test_every_file_gives_a_pod_the_same():
    deployment = yaml.safe_load((ROOT / "deploy/kubernetes/base/deployment.yaml").read_text())
    (container,) = deployment["spec"]["template"]["spec"]["containers"]
    kserve = yaml.safe_load((ROOT / "deploy/kserve/inference-service.yaml").read_text())
    (predictor,) = kserve["spec"]["predictor"]["containers"]
    compose = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
    wanted = {"cpu": str(SIZING["POD_CORES"]), "memory": f"{SIZING['POD_MEMORY_MIB'] // 1024}Gi"}
    for of in (container, predictor):
        assert of["resources"] == {"requests": wanted, "limits": wanted}
    assert compose["services"]["shipshape"]["mem_limit"] == f"{SIZING['POD_MEMORY_MIB'] // 1024}g"
