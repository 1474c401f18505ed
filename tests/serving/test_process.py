"""The real thing: a process, with the shipped bundle where there is one, from start to a signal."""

import hashlib
import json
import math
import re
import shutil
import signal

import grpc
import httpx
import numpy as np
import pytest

from serving.fakes import PATIENCE, cluster, request, rows
from serving.processes import MODELS, SERVE_FAKES, START_PATIENCE, TESTS, start, stopped_by, until_ready
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

CONTACTS = TESTS.parent / "examples/contacts.npz"
needs_models = pytest.mark.skipif(
    not (MODELS / "manifest.toml").is_file(), reason="models/ has no manifest.toml yet"
)


def flip_a_byte(network):
    content = bytearray(network.read_bytes())
    content[len(content) // 2] ^= 1
    network.write_bytes(content)


def cut_short(network):
    network.write_bytes(network.read_bytes()[:-1000])


def cut_short_and_signed(network):
    before = hashlib.sha256(network.read_bytes()).hexdigest()
    cut_short(network)
    manifest = network.with_name("manifest.toml")
    after = hashlib.sha256(network.read_bytes()).hexdigest()
    manifest.write_text(manifest.read_text().replace(before, after))


def take_away(network):
    network.unlink()


def test_a_process_serves_and_stops_when_told_to():
    with start("-c", SERVE_FAKES) as process:
        try:
            rest_port, grpc_port = until_ready(process)
            with grpc.insecure_channel(f"127.0.0.1:{grpc_port}") as channel:
                assert (
                    ShipshapeStub(channel).Recognise(request(cluster()), timeout=PATIENCE).recognition.vessel
                    == "tug"
                )
            assert httpx.get(f"http://127.0.0.1:{rest_port}/readyz", trust_env=False).status_code == 200
            stopped_by(process, signal.SIGINT)
        finally:
            process.kill()


@needs_models
def test_the_shipped_bundle_through_both_doors():
    sample = np.load(CONTACTS, allow_pickle=False)
    points = sample["points"][: sample["n"][0]].astype("<f4")
    height = float(sample["sensor_height"])
    with start("-m", "shipshape", "serve", SHIPSHAPE_BUNDLE=str(MODELS)) as process:
        try:
            rest_port, grpc_port = until_ready(process)
            with grpc.insecure_channel(f"127.0.0.1:{grpc_port}") as channel:
                asked = request(points, sensor_height_m=height)
                response, call = ShipshapeStub(channel).Recognise.with_call(asked, timeout=PATIENCE)
            with httpx.Client(base_url=f"http://127.0.0.1:{rest_port}", timeout=PATIENCE, trust_env=False) as rest:
                body = {"points": rows(points), "sensor_height_m": height}
                by_rest, metrics = rest.post("/v1/recognise", json=body), rest.get("/metrics").text
            found, answer = response.recognition, by_rest.json()
            assert found.vessel == answer["vessel"] == sample["vessel"][0]
            assert found.heading == pytest.approx(answer["heading"], abs=1e-6)
            assert abs(math.remainder(found.heading - sample["heading"][0], math.tau)) < math.radians(10)
            for timing in (dict(call.trailing_metadata())["server-timing"], by_rest.headers["Server-Timing"]):
                assert re.findall(r"(\w+);dur=[\d.]+", timing) == list(answer["stage_ms"])
            for door in ("grpc", "rest"):
                assert f'shipshape_contacts_total{{door="{door}",outcome="ok"}} 1.0' in metrics
            assert 'shipshape_stage_seconds_count{stage="classification"} 2.0' in metrics
            stopped_by(process, signal.SIGTERM)
        finally:
            process.kill()


@needs_models
def test_a_signal_during_the_warm_up_ends_the_process():
    with start("-m", "shipshape", "serve", SHIPSHAPE_BUNDLE=str(MODELS)) as process:
        try:
            messages = (json.loads(line)["message"] for line in process.stderr)
            assert any(message.startswith("live on ") for message in messages)
            process.send_signal(signal.SIGTERM)
            assert not [message for message in messages if message.startswith("ready: ")]
            assert process.wait(START_PATIENCE) == 0
        finally:
            process.kill()


@needs_models
@pytest.mark.parametrize("damage", [flip_a_byte, cut_short, cut_short_and_signed, take_away])
def test_a_damaged_bundle_never_opens_a_port(damage, tmp_path):
    bundle = tmp_path / "bundle"
    shutil.copytree(MODELS, bundle)
    damage(bundle / "prior.onnx")
    with start("-m", "shipshape", "serve", SHIPSHAPE_BUNDLE=str(bundle)) as process:
        try:
            output = process.stderr.read()
            assert process.wait(START_PATIENCE) == 2
        finally:
            process.kill()
    # The only line: that of a port which is open would say "live".
    assert re.fullmatch(r"shipshape: expected .*prior.*, got:? .+\n", output)
