"""The manifests: built by the real kustomize, held to the schemas of Kubernetes and to what the service needs."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from architecture.tree import ROOT
from deploy import test_monitoring
from shipshape.settings import PREFIX, Settings

KUBERNETES = ROOT / "deploy/kubernetes"
KUBECTL = shutil.which("kubectl") or shutil.which("kustomize")
VALIDATE = Path(sys.executable).parent / "kubernetes-validate"
OWN_KINDS = ("ScaledObject",)  # of KEDA: in no schema of Kubernetes
SETTINGS = {f"{PREFIX}{name}".upper() for name in Settings.model_fields}
EXIT_S = 3.0  # docs/operations.md: what a stop takes beside linger and drain


def built(name):
    """The objects of a folder by kind and name."""
    if KUBECTL is None:
        pytest.skip("neither kubectl nor kustomize is installed")
    verb = "kustomize" if KUBECTL.endswith("kubectl") else "build"
    made = subprocess.run([KUBECTL, verb, KUBERNETES / name], capture_output=True, text=True, check=True).stdout
    return {f"{each['kind']}/{each['metadata']['name']}": each for each in yaml.safe_load_all(made)}


def pod(deployment):
    return deployment["spec"]["template"]["spec"]


@pytest.mark.parametrize("name", ["base", "hpa", "keda"])
def test_all_is_of_the_schemas_of_kubernetes(name, tmp_path):
    file = tmp_path / "built.yaml"
    objects = [each for each in built(name).values() if each["kind"] not in OWN_KINDS]
    file.write_text(yaml.safe_dump_all(objects))
    checked = subprocess.run([VALIDATE, "--strict", "--quiet", file], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_every_probe_asks_the_health_port_for_its_own_state():
    (container,) = pod(built("base")["Deployment/shipshape"])["containers"]
    ports = {port["name"]: port["containerPort"] for port in container["ports"]}
    assert ports == {"rest": 8080, "grpc": 50051, "health": 9091}
    for probe, path in (("startup", "/startedz"), ("readiness", "/readyz"), ("liveness", "/livez")):
        assert container[f"{probe}Probe"]["httpGet"] == {"path": path, "port": "health"}


def test_pods_are_given_the_time_to_drain():
    objects = built("base")
    (settings,) = (each["data"] for each in objects.values() if each["kind"] == "ConfigMap")
    assert set(settings) <= SETTINGS
    of = pod(objects["Deployment/shipshape"])
    (container,) = of["containers"]
    stop = container["lifecycle"]["preStop"]["sleep"]["seconds"]
    stop += float(settings["SHIPSHAPE_LINGER_S"]) + float(settings["SHIPSHAPE_DRAIN_S"]) + EXIT_S
    assert of["terminationGracePeriodSeconds"] > stop


def inference_service():
    return yaml.safe_load((ROOT / "deploy/kserve/inference-service.yaml").read_text())["spec"]["predictor"]


def test_kserve_runs_the_pod_as_kubernetes_does():
    of, theirs = pod(built("base")["Deployment/shipshape"]), inference_service()
    for name in ("enableServiceLinks", "automountServiceAccountToken", "terminationGracePeriodSeconds"):
        assert theirs[name] == of[name], name
    assert theirs["securityContext"] == of["securityContext"]
    assert theirs["volumes"] == of["volumes"]
    (ours,), (other,) = of["containers"], theirs["containers"]
    for name in ("resources", "securityContext", "lifecycle", "volumeMounts"):
        assert other[name] == ours[name], name
    assert {each["name"] for each in other["env"]} <= SETTINGS


def test_pods_are_locked_down():
    of = pod(built("base")["Deployment/shipshape"])
    (container,) = of["containers"]
    assert of["enableServiceLinks"] is False  # variables SHIPSHAPE_* of other Services would stop the start
    assert of["automountServiceAccountToken"] is False
    assert of["securityContext"]["runAsNonRoot"] is True
    assert container["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }


def test_services_budget_and_policy_mean_the_pods():
    objects = built("base")
    labels = objects["Deployment/shipshape"]["spec"]["template"]["metadata"]["labels"]
    selectors = [objects[f"Service/{name}"]["spec"]["selector"] for name in ("shipshape", "shipshape-pods")]
    selectors += [objects["PodDisruptionBudget/shipshape"]["spec"]["selector"]["matchLabels"]]
    selectors += [objects["NetworkPolicy/shipshape"]["spec"]["podSelector"]["matchLabels"]]
    assert all(selector and selector.items() <= labels.items() for selector in selectors)
    assert objects["Service/shipshape-pods"]["spec"]["clusterIP"] == "None"


@pytest.mark.parametrize(("name", "kind"), [("hpa", "HorizontalPodAutoscaler"), ("keda", "ScaledObject")])
def test_an_autoscaler_has_the_number_of_pods_to_itself(name, kind):
    objects = built(name)
    assert "replicas" not in objects["Deployment/shipshape"]["spec"]
    assert objects[f"{kind}/shipshape"]["spec"]["scaleTargetRef"]["name"] == "shipshape"


def test_autoscalers_ask_for_metrics_that_dashboards_show():
    shown = set(re.findall(r"shipshape_\w+", json.dumps(test_monitoring.queries())))
    asked = (KUBERNETES / "keda/scaled-object.yaml").read_text()
    asked += "".join(rule["metricsQuery"] for rule in adapter_rules())
    names = set(re.findall(r"shipshape_\w+", asked))
    assert names
    assert names <= shown
    wanted = {
        metric["pods"]["metric"]["name"]
        for metric in built("hpa")["HorizontalPodAutoscaler/shipshape"]["spec"]["metrics"]
        if metric["type"] == "Pods"
    }
    assert wanted == {rule["name"]["as"] for rule in adapter_rules()}


def adapter_rules():
    return yaml.safe_load((KUBERNETES / "hpa/adapter-rules.yaml").read_text())["rules"]["custom"]
