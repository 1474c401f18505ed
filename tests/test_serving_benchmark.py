"""The parts of the serving benchmark that need no server; what it measures is checked by its own runs."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.serving import page, plot, summary, wires
from benchmarks.serving.__main__ import main
from benchmarks.serving.contacts import COUNT, POINTS, contacts
from benchmarks.serving.processes import free_ports
from benchmarks.serving.servers import SERVERS
from shipshape.v1 import shipshape_pb2 as pb

ROOT = Path(__file__).parents[1]
PEERS = ROOT / "benchmarks/serving/peers"
ROUND = {
    "efficiency": 0.9,
    "throughput_over_limit": 0.8,
    "p99_over_p50": 2.0,
    "rss_mb": 250.0,
    "ready_s": 1.5,
    "p50_ms": 4.0,
}


@pytest.fixture
def clusters(monkeypatch):
    monkeypatch.chdir(ROOT)
    return contacts(5)


def rounds(**efficiencies):
    return {name: [{**ROUND, "efficiency": value} for value in values] for name, values in efficiencies.items()}


def test_a_number_is_the_median_of_the_rounds_beside_their_spread():
    numbers = summary.flat(rounds(mosec=[0.8, 0.9, 0.85]))
    keys = ("efficiency.mosec", "least.efficiency.mosec", "most.efficiency.mosec")
    assert [numbers[key] for key in keys] == [0.85, 0.8, 0.9]


def test_a_server_that_failed_in_a_round_keeps_its_numbers_and_says_why():
    numbers = summary.flat({"robyn": [*rounds(robyn=[0.9])["robyn"], {"failed": "no answer"}]})
    assert (numbers["efficiency.robyn"], numbers["failed.robyn"]) == (0.9, "no answer")


def test_the_service_is_reported_by_its_rest_door():
    numbers = summary.flat(rounds(rest_binary=[0.9]))
    assert (numbers["p99_over_p50.at_70pct"], numbers["ready_s"], numbers["rss_mb"]) == (2.0, 1.5, 250.0)


def test_the_worse_overload_counts():
    overload = {"refusal_p99_ms.at_2x": 1.0, "refusal_p99_ms.at_5x": 3.0, "goodput.at_2x": 0.95}
    numbers = summary.flat({"rest_binary": [ROUND | overload]})
    assert (numbers["refusal_p99_ms"], numbers["goodput.at_2x"]) == (3.0, 0.95)


def test_a_target_that_is_met_is_not_complained_about_and_others_are():
    numbers = summary.flat(rounds(rest_binary=[0.93], grpc_unary=[0.7], mosec=[0.94]))
    sentences = summary.short_of_targets(numbers)
    assert "efficiency.grpc_unary: expected >= 0.85, got 0.7" in sentences
    assert "goodput.at_2x: expected >= 0.9, not measured" in sentences
    assert "efficiency.rest_binary: expected to be ahead of every peer, got behind mosec" in sentences
    assert not any(sentence.startswith("efficiency.rest_binary: expected >=") for sentence in sentences)


def test_a_server_without_numbers_is_in_the_table_with_the_reason():
    numbers = summary.flat({**rounds(rest_binary=[0.9], robyn=[0.91]), "pytriton": [{"failed": "no binary"}]})
    rows = [row.split(" | ")[0].strip("| *") for row in page.table(numbers, SERVERS).splitlines()[2:]]
    assert rows == ["robyn", "rest_binary", "pytriton"]
    assert "failed: no binary" in page.table(numbers, SERVERS)


def test_page_and_plot_are_made_of_what_there_is(tmp_path):
    numbers = summary.flat(rounds(rest_binary=[0.9, 0.8], mosec=[0.85, 0.86]))
    assert "| mosec |" in page.page({"about.machine": "one", **numbers}, SERVERS, "command")
    plot.draw(numbers, SERVERS, tmp_path / "serving.png")
    assert (tmp_path / "serving.png").read_bytes().startswith(b"\x89PNG")


def test_rounds_of_other_code_are_not_mixed_in(tmp_path, monkeypatch):
    (tmp_path / "plan.txt").write_text("of code that is no more")
    monkeypatch.setattr("sys.argv", ["serving", "--run", str(tmp_path)])
    with pytest.raises(SystemExit, match=r"code that is no more, got Plan.*: choose another --run"):
        main()


def test_all_servers_are_sent_the_same_points(clusters):
    assert len(clusters) == COUNT
    assert all(len(points) <= POINTS for points in clusters)
    sent = wires.unary(clusters).requests[0]
    packed = np.frombuffer(pb.RecogniseRequest.FromString(sent).contact.points, "<f4").reshape(-1, 3)
    body = wires.as_json("/json")(clusters).requests[0].partition(b"\r\n\r\n")[2]
    rows = np.array(json.loads(body)["points"], np.float32)
    np.testing.assert_array_equal(packed, clusters[0])
    np.testing.assert_array_equal(rows, clusters[0])
    assert wires.binary("/")(clusters).requests[0].endswith(packed.tobytes())


def test_peers_compute_with_the_libraries_of_the_service():
    pins = dict(re.findall(r"^([\w-]+)==([\w.]+)", (PEERS / "pipeline.in").read_text(), re.M))
    lock = (ROOT / "requirements/service.lock").read_text()
    assert pins
    for name, version in pins.items():
        assert re.search(rf"^{name}=={re.escape(version)}\b", lock, re.M), name


@pytest.mark.parametrize(
    "server", [server for server in SERVERS if server.environment], ids=lambda server: server.name
)
def test_every_peer_is_a_script_with_pinned_requirements(server):
    assert (PEERS / f"{server.environment}.py").exists()
    assert re.search(
        rf"^{server.package}==[\w.]+ \\\n +--hash=", (PEERS / f"{server.environment}.txt").read_text(), re.M
    )


def test_ports_are_free():
    assert 1024 < free_ports() < 65534
