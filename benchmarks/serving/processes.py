"""A server as processes: started on its cores, measured with all its children, stopped."""

import os
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from benchmarks.serving.environments import variables
from benchmarks.serving.servers import Server

STOP_WITHIN_S = 20.0
PORTS = 3  # in a row: some peers listen on more than one


@contextmanager
def running(server: Server, cores: tuple[int, ...], log: Path) -> Iterator[tuple[psutil.Popen, int]]:
    """The server's first process and its port, maybe not ready yet; all that it started ends with the block.

    Args:
        server: Its environment must be prepared.
        cores: It stays on these.
        log: Its output.
    """
    port = free_ports()
    fields = {
        "python": server.python,
        "bin": server.python.parent,
        "port": port,
        "grpc_port": port + 1,
        "cores": len(cores),
    }
    command = [part.format(**fields) for part in server.command]
    log.parent.mkdir(parents=True, exist_ok=True)
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)  # inherited
    try:
        with log.open("wb") as stream:
            process = psutil.Popen(
                command,
                env=variables(server) | {"PORT": str(port), "CORES": str(len(cores))},
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                start_new_session=True,
            )
    finally:
        os.sched_setaffinity(0, before)
    try:
        yield process, port
    finally:
        _stop(process)


def cpu_s(process: psutil.Process) -> float:
    """Processor seconds that the process and all its descendants have used, those that ended included."""
    return sum(sum(member.cpu_times()[:4]) for member in _family(process))


def rss_mb(process: psutil.Process) -> float:
    """Resident megabytes of the process and all its descendants; a page that several share counts once in all."""
    return sum(member.memory_full_info().pss for member in _family(process)) / 1e6


def free_ports() -> int:
    """The first of `PORTS` ports in a row that nobody listens on."""
    while True:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = int(taken.getsockname()[1])
        with suppress(OSError, OverflowError):
            for offset in range(PORTS):
                socket.create_server(("127.0.0.1", port + offset)).close()
            return port


def _family(process: psutil.Process) -> list[psutil.Process]:
    return [process, *process.children(recursive=True)]


def _stop(process: psutil.Popen) -> None:
    members = [member for member in _family(process) if member.is_running()] if process.is_running() else []
    with suppress(ProcessLookupError):
        os.kill(process.pid, signal.SIGTERM)
    _, alive = psutil.wait_procs(members, STOP_WITHIN_S)
    for member in alive:
        with suppress(psutil.NoSuchProcess):
            member.kill()
    psutil.wait_procs(alive, STOP_WITHIN_S)
