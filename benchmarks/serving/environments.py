"""A virtual environment a peer, of exactly what its requirements pin, under runs/."""

import os
import subprocess
import sys
from pathlib import Path

from benchmarks.serving.servers import ENVIRONMENTS, Server

REQUIREMENTS = Path(__file__).parent / "peers"
MADE = "made_of.txt"  # in an environment: the requirements it was made of
COMPILE = "from benchmarks.serving.peers.recognise import load; load()"
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def prepare(server: Server) -> None:
    """Make the peer's environment, unless it is there of the same requirements, and compile the inner loops.

    Raises:
        RuntimeError: It cannot be installed, or the pipeline does not run in it; the message says why.
    """
    if server.environment:
        _make(server)
    _run(str(server.python), "-c", COMPILE, env=variables(server))


def variables(server: Server) -> dict[str, str]:
    """The environment variables of its processes."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("SHIPSHAPE_")}
    # Compiled loops are kept apart: another version of a library would compile them anew at every start.
    compiled = str(Path("runs/serving/compiled", server.environment or "ours").resolve())
    return {
        **own,
        **dict.fromkeys(THREADS, "1"),
        "PATH": f"{server.python.parent}{os.pathsep}{own.get('PATH', '')}",
        "PYTHONPATH": os.pathsep.join((".", "service")),
        "NUMBA_CACHE_DIR": compiled,
        "BENTOML_DO_NOT_TRACK": "True",
    }


def version(server: Server) -> str:
    """Of the server's package, as its environment has it."""
    code = f"import importlib.metadata as m; print(m.version({server.package!r}))"
    return subprocess.run([server.python, "-c", code], check=True, capture_output=True, text=True).stdout.strip()


def _make(server: Server) -> None:
    pins, folder = REQUIREMENTS / f"{server.environment}.txt", ENVIRONMENTS / server.environment
    made = folder / MADE
    if made.exists() and made.read_text() == pins.read_text():
        return
    uv = str(Path(sys.executable).with_name("uv"))
    _run(uv, "venv", "--quiet", "--clear", "--python", sys.executable, str(folder))
    _run(uv, "pip", "install", "--quiet", "--python", str(server.python), "--require-hashes", "-r", str(pins))
    made.write_text(pins.read_text())


def _run(*command: str, env: dict[str, str] | None = None) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=env)
    if done.returncode:
        words = " ".join(done.stderr.split())
        raise RuntimeError(f"expected {' '.join(command[:3])} to succeed, got: {words[-300:]}")
