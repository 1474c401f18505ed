"""The whole command: exit codes and what it prints and writes, against a queue on paper and a real service."""

import argparse
import json
import re
from html.parser import HTMLParser

import pytest

from loadtest.simulated import QueueProcesses
from serving.fakes import DIGEST, running
from shipshape.cli import build_parser, main
from shipshape.loadtest import command
from shipshape.loadtest.options import options_of
from shipshape.loadtest.processes import Processes
from shipshape.loadtest.targets.target import TargetError

TWO_PROCESSES = ["--contacts", "4", "--processes", "2", "--arrivals", "constant"]
TARGET = "grpc://127.0.0.1:50051"
GENEROUS = ["--budget", "p50=60s", "--rate", "40", "--duration", "1s", "--warmup", "500ms"]


@pytest.fixture
def on_paper(monkeypatch):
    """The command with a target of one worker that takes 10 ms a request: 100 contacts a second and no more."""

    def run(*arguments, work_s=0.01, lag_s=0.0):
        processes = QueueProcesses(work_s, lag_s)
        monkeypatch.setattr(command, "Processes", processes)
        code = main(["loadtest", TARGET, *arguments])
        return code, processes

    return run


def test_a_budget_that_is_held_is_0(on_paper, capsys):
    code, processes = on_paper("--rate", "50", "--arrivals", "constant", "--duration", "10s")
    assert code == 0
    out = capsys.readouterr().out
    assert "held: 100.00% of 500 requests were answered within 50 ms" in out
    assert len(processes.plans) == 1


def test_a_budget_that_is_not_held_is_1(on_paper, capsys):
    code, _ = on_paper("--rate", "130", "--arrivals", "constant", "--duration", "10s")
    assert code == 1
    assert "not held: " in capsys.readouterr().out


def test_a_tool_that_lags_is_3(on_paper, capsys):
    code, _ = on_paper("--rate", "50", "--duration", "10s", lag_s=0.006)
    assert code == 3
    assert "the tool itself was too slow to tell" in capsys.readouterr().out


def test_a_sweep_finds_what_the_target_can_do(on_paper, capsys, tmp_path):
    report = tmp_path / "sweep.json"
    code, processes = on_paper(
        "--sweep", "--rate", "30", "--arrivals", "constant", "--duration", "10s", "--json", str(report)
    )
    found = json.loads(report.read_text())
    # A queue that grows from 0 for 5 s keeps 99 % within 50 ms up to just above 100 requests a second.
    assert found["highest_rate"] == pytest.approx(100, rel=0.06)
    assert code == 0
    assert [step["rate"] for step in found["sweep"]][:3] == [30, 60, 120]
    assert len(processes.plans) == len(found["sweep"]) + 1
    assert found["run"]["offered"] == pytest.approx(found["highest_rate"], rel=0.01)
    assert "highest rate found" in capsys.readouterr().out


def test_a_sweep_that_ends_at_the_tools_own_limit_says_so(on_paper, capsys):
    code, _ = on_paper("--sweep", "--rate", "30", lag_s=1.0)
    assert code == 3
    assert "the tool itself was too slow" in capsys.readouterr().out


def test_a_sweep_in_which_nothing_holds_is_1(on_paper, capsys):
    code, processes = on_paper("--sweep", "--rate", "4", "--step", "1s", work_s=0.2)
    assert code == 1
    assert [plan.seconds for plan in processes.plans] == [50, 100, 200]  # as long as it takes for 200 requests
    assert "highest rate found: 0 contacts/s" in capsys.readouterr().out


def test_the_plan_is_what_the_arguments_ask_for():
    def plan_of(*arguments):
        parsed = build_parser().parse_args(["loadtest", TARGET, "--seed", "3", *arguments])
        return options_of(parsed).plan(parsed.rate, 60.0)

    single, scans = plan_of("--rate", "100"), plan_of("--rate", "100", "--contacts", "5")
    assert len(single.due) == pytest.approx(6300, rel=0.05)
    assert scans.contacts.sum() == pytest.approx(6300, rel=0.1)
    assert plan_of("--warmup", "0s").due[0] >= 0
    assert single.deadline_s == 0.05
    assert plan_of("--budget", "p90=20ms").deadline_s == 0.02
    assert plan_of("--deadline", "3s").deadline_s == 3.0
    assert single.due[0] < 0 < single.due[-1] < 60
    assert {len(request.clusters[0]) for request in single.requests} == {300}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--budget", "50ms"], "a budget like p99=50ms"),
        (["--rate", "0"], "--rate above 0"),
        (["--rate", "nan"], "--rate above 0"),
        (["--rate", "1e12"], "--rate above 0 and up to 1000000"),
        (["--seed", "-1"], "--seed of 0 or more"),
        (["--cert", "own.pem"], "both --cert and --key"),
        (["--key", "own.key"], "both --cert and --key"),
        (["--contacts", "0"], "for --contacts"),
        (["--processes", "-1"], "for --processes"),
        (["--points", "50,x"], "for --points"),
        (["--lanes", "collision,fast"], "--lanes of collision, tracking, batch, got 'fast'"),
        (["--arrivals", "poison"], "--arrivals poisson, constant, bursts:N or a .csv"),
        (["--arrivals", "bursts:x"], "--arrivals bursts:N"),
        (["--arrivals", "none.csv"], "to read none.csv"),
        (["--arrivals", "none.csv", "--contacts", "2"], "got --contacts 2"),
        (["--duration", "soon"], "a time like"),
        (["--step", "soon", "--sweep"], "a time like"),
        (["--duration", "1s", "--rate", "50"], "100 requests or more to judge p99 <= 50 ms"),
        (["--clusters", "none.npz"], "none.npz"),
        (["--json", "nowhere/x.json"], "a folder nowhere"),
        (["--token-file", "none"], "to read a token"),
    ],
)
def test_a_wrong_command_is_2_and_one_sentence(on_paper, capsys, arguments, words):
    assert on_paper(*arguments)[0] == 2
    error = capsys.readouterr().err
    assert error.startswith("shipshape: expected ")
    assert words in error
    assert error.count("\n") == 1


def test_a_protocol_without_lanes_is_sent_none(capsys):
    assert main(["loadtest", "oip+http://127.0.0.1:1/m", "--lanes", "batch"]) == 2
    assert "--lanes with gRPC or REST" in capsys.readouterr().err


def test_no_target_is_2(capsys):
    assert main(["loadtest", "http://127.0.0.1:1", *GENEROUS]) == 2
    assert capsys.readouterr().err.startswith("shipshape: expected a description at http://127.0.0.1:1/v1/model")


@pytest.mark.parametrize("seen", [False, True])  # by the time of the order, or not yet
def test_a_process_that_dies_is_told(seen):
    with running() as doors:
        arguments = argparse.Namespace(
            **vars(build_parser().parse_args(["loadtest", f"grpc://127.0.0.1:{doors.addresses.grpc_port}"]))
        )
        test = options_of(arguments)
        with Processes(test.address, 1) as processes:
            processes._processes[0].kill()
            if seen:
                processes._processes[0].join()
            with pytest.raises(TargetError, match="expected the sending processes to live"):
                processes.run(test.plan(100.0, 2.0))


class Page(HTMLParser):
    """Collects what a page asks for from elsewhere, its pictures, and its text."""

    def __init__(self, text):
        super().__init__()
        self.wanted, self.pictures, self.text = [], 0, ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.pictures += tag == "svg"
        self.wanted += [value for name, value in attributes if name in ("src", "href", "xlink:href", "action")]

    def handle_data(self, data):
        self.text += data


def test_over_grpc_with_everything_written(doors, tmp_path, capsys):
    numbers, page = tmp_path / "numbers.json", tmp_path / "page.html"
    url = f"grpc://127.0.0.1:{doors.addresses.grpc_port}"
    doors.pipeline.computed.clear()
    code = main(["loadtest", url, *GENEROUS, "--points", "20,50", "--json", str(numbers), "--report", str(page)])
    assert code == 0
    found = json.loads(numbers.read_text())
    assert set(found) == {
        "started", "tool", "verdict", "sentence", "target", "machine", "settings", "run", "sweep", "highest_rate",
    }  # fmt: skip
    assert set(found["run"]) == {
        "verdict", "budget", "seconds", "warmup_requests", "requests", "contacts", "outcomes", "in_budget",
        "offered", "throughput", "goodput", "latency", "service", "refusal", "lag", "groups", "timeline",
        "complaints",
    }  # fmt: skip
    assert set(found["run"]["latency"]) == {"count", "mean", "max", "percentiles", "curve", "hdr"}
    assert found["target"]["bundle"] == DIGEST
    assert found["verdict"] == "held"
    assert found["run"]["outcomes"]["ok"] == found["run"]["requests"] == found["run"]["in_budget"]
    assert len(doors.pipeline.computed) == found["run"]["requests"] + found["run"]["warmup_requests"]
    shown = Page(page.read_text())
    assert shown.pictures == 3
    assert [link for link in shown.wanted if not link.startswith("#")] == []
    assert not re.search(r"url\((?!#)|@import", page.read_text())
    assert found["sentence"][1:] in shown.text
    assert DIGEST in shown.text
    assert "50 points" in capsys.readouterr().out


def test_scans_over_rest_from_two_processes(doors):
    doors.pipeline.computed.clear()
    url = f"http://127.0.0.1:{doors.addresses.rest_port}"
    assert main(["loadtest", url, *GENEROUS, *TWO_PROCESSES, "--lanes", "batch"]) == 0
    assert len(doors.pipeline.computed) == 60  # 1.5 s of 40 a second


def test_a_service_that_answers_with_errors_does_not_hold_and_is_quoted(capsys, tmp_path):
    page = tmp_path / "page.html"
    with running(max_points=1000) as doors:
        url = f"http://127.0.0.1:{doors.addresses.rest_port}"
        assert main(["loadtest", url, *GENEROUS, "--points", "1001", "--report", str(page)]) == 1
    out = capsys.readouterr().out
    assert "error: 413: expected at most 1000 points in a contact, got 1001" in out
    assert "expected at most 1000 points" in Page(page.read_text()).text
