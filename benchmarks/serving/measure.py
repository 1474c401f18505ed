"""One server in one round: start, check the answers, closed loop, open loop, and the bare pipeline in turns."""

import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import psutil

from benchmarks.serving import client, processes
from benchmarks.serving.bare import Bare, Limit, pinned
from benchmarks.serving.client import Load
from benchmarks.serving.contacts import contacts
from benchmarks.serving.servers import SERVERS, Server
from benchmarks.serving.wires import Wire, binary, scan

READY_WITHIN_S = 120.0
WARM_SHARE = 0.25  # of the seconds of a measurement, sent before and not counted
BUSY_SHARE = 0.7  # of the capacity, for the tail
OVERLOADS = (2, 5)
BUDGET_MS = 50.0
POLL_S = 0.02  # between two looks whether a server answers
UNDER_BUDGET = binary("/v1/recognise?lowest_rung=full", f"Shipshape-Timeout-Ms: {BUDGET_MS}\r\n")
Numbers = dict[str, float]


@dataclass(frozen=True, slots=True)
class Plan:
    """How to measure.

    Attributes:
        seconds: Of each measurement.
        server_cores: Every server and the limit stay on these.
        client_cores: The load generator stays on these.
        seed: Of contacts and arrivals.
    """

    seconds: float
    server_cores: tuple[int, ...]
    client_cores: tuple[int, ...]
    seed: int


def measure(server: Server, plan: Plan, limit: Limit, log: Path) -> Numbers:
    """Everything about one server.

    Raises:
        RuntimeError: It does not start, answers something else, or fails requests.
    """
    wire = server.write(contacts(plan.seed))
    with (
        pinned(plan.client_cores) as generator,
        processes.running(server, plan.server_cores, log) as (process, port),
    ):
        started = time.perf_counter()
        until_ready(generator, wire, process, port)
        found = {"ready_s": time.perf_counter() - started}
        _check(generator.submit(client.probe, wire, port, READY_WITHIN_S).result(), wire, limit.vessels())
        generator.submit(client.closed, wire, port, plan.seconds * WARM_SHARE).result()
        before = limit.run(plan.seconds / 2)
        busy = processes.cpu_s(process)
        load = generator.submit(client.closed, wire, port, plan.seconds).result()
        busy = processes.cpu_s(process) - busy
        found["rss_mb"] = processes.rss_mb(process)
        after = limit.run(plan.seconds / 2)
        _all_answered(load)
        found |= _efficiency(load, busy, [before, after])
        capacity = load.contacts / load.seconds
        rate = BUSY_SHARE * capacity / wire.contacts
        calm = generator.submit(client.open_loop, wire, port, plan.seconds, rate, plan.seed).result()
        _all_answered(calm)
        found |= _tail(calm)
        if server.name == "rest_binary":
            for factor in OVERLOADS:
                found |= _overload(generator, port, plan, factor, capacity)
    return found


def scaling(plan: Plan, log: Path) -> Numbers:
    """Contacts a second on two cores over those on one: our scans of 32, which take little to generate."""
    server = next(server for server in SERVERS if server.name == "grpc_scan32")
    wire = scan(32)(contacts(plan.seed))
    cores = (plan.server_cores + plan.client_cores)[:2]
    if len(cores) < 2 or cores[0] == cores[1]:
        raise RuntimeError("expected two cores to scale to, got one")
    rates = []
    for used in (cores[:1], cores):
        with pinned(plan.client_cores) as generator, processes.running(server, used, log) as (process, port):
            until_ready(generator, wire, process, port)
            generator.submit(client.closed, wire, port, plan.seconds * WARM_SHARE).result()
            load = generator.submit(client.closed, wire, port, plan.seconds).result()
            _all_answered(load)
            rates.append(load.contacts / load.seconds)
    return {"scaling.1_to_2": rates[1] / rates[0]}


def until_ready(generator: ProcessPoolExecutor, wire: Wire, process: psutil.Popen, port: int) -> None:
    """Wait for the first answer; raises RuntimeError when the server ends or is too slow."""
    first, started = replace(wire, requests=wire.requests[:1]), time.perf_counter()
    while not generator.submit(client.probe, first, port, 5.0).result():
        if process.poll() is not None:
            raise RuntimeError(f"expected the server to start, got exit code {process.returncode}")
        if time.perf_counter() - started > READY_WITHIN_S:
            raise RuntimeError(f"expected an answer within {READY_WITHIN_S:.0f} s of the start, got none")
        time.sleep(POLL_S)


def _check(bodies: list[bytes] | None, wire: Wire, expected: list[str]) -> None:
    if bodies is None:
        raise RuntimeError("expected an answer to every contact, got a refusal or none")
    named = [vessel for body in bodies for vessel in wire.read(body)]
    if named != [expected[index % len(expected)] for index in range(len(named))]:
        raise RuntimeError(f"expected the vessels of the bare pipeline, {expected}, got {named}")


def _all_answered(load: Load) -> None:
    if set(load.statuses) != {200}:
        raise RuntimeError(f"expected only status 200, got {load.statuses} (0: the connection broke)")


def _efficiency(load: Load, busy_s: float, bare: list[Bare]) -> Numbers:
    done = sum(turn.contacts for turn in bare)
    limit = done / sum(turn.seconds for turn in bare)
    limit_cpu = sum(turn.cpu_s for turn in bare) / done
    return {
        "efficiency": limit_cpu / (busy_s / load.contacts),
        "throughput": load.contacts / load.seconds,
        "throughput_over_limit": load.contacts / load.seconds / limit,
        "cpu_ms": busy_s / load.contacts * 1e3,
        "limit_cpu_ms": limit_cpu * 1e3,
    }


def _tail(load: Load) -> Numbers:
    p50, p99 = np.percentile(load.latency_ms, (50, 99))
    return {"p99_over_p50": p99 / p50, "p50_ms": p50, "p99_ms": p99, "lag_ms": load.lag_ms}


def _overload(generator: ProcessPoolExecutor, port: int, plan: Plan, factor: int, capacity: float) -> Numbers:
    wire = UNDER_BUDGET(contacts(plan.seed))
    load = generator.submit(client.open_loop, wire, port, plan.seconds, factor * capacity, plan.seed).result()
    good = np.count_nonzero(load.latency_ms <= BUDGET_MS) / load.seconds
    return {
        f"goodput.at_{factor}x": good / capacity,
        f"accepted_p99_ms.at_{factor}x": float(np.percentile(load.latency_ms, 99)),
        f"refusal_p99_ms.at_{factor}x": float(np.percentile(load.refused_ms, 99)),
        f"lag_ms.at_{factor}x": load.lag_ms,
        f"offered.at_{factor}x": sum(load.statuses.values()) / load.seconds / capacity,
    }
