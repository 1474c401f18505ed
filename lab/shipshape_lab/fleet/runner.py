"""Runs steps side by side, each in a process of its own, under one bar; a run that was stopped goes on.

A step whose file is there is done. The lines under the bar are the bars of the steps themselves, from their logs.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from shipshape_lab.fleet.steps import Step

POLL_S = 0.5
TAIL_BYTES = 400
BAR = "{desc} |{bar:30}|"


@dataclass
class _Running:
    """A step under way."""

    step: Step
    process: subprocess.Popen
    began: float


def run_steps(steps: Sequence[Step], *, lanes: int, logs: Path) -> None:
    """Run every step that is not done, at most `lanes` at a time.

    Args:
        steps: each after the steps that it needs.
        lanes: processes side by side.
        logs: folder for NAME.log of each step.

    Raises:
        RuntimeError: a step failed; its log says why. The others are stopped.
    """
    logs.mkdir(parents=True, exist_ok=True)
    # A plain kill ends this process as Ctrl-C does, so that no step is left behind.
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    running: list[_Running] = []
    display = _Display(steps, lanes)
    try:
        done = {step.name for step in steps if step.made.exists()}
        while len(done) < len(steps):
            for found in [r for r in running if r.process.poll() is not None]:
                running.remove(found)
                _finish(found, logs)
                done.add(found.step.name)
                display.tell(found.step.name, time.monotonic() - found.began)
            running += [_start(step, logs) for step in _next(steps, done, running, lanes)]
            display.show(done, running, logs)
            time.sleep(POLL_S)
    finally:
        for left in running:
            if left.process.poll() is None:
                os.killpg(left.process.pid, signal.SIGTERM)  # with the processes that it started itself
                left.process.wait()
        display.close()
        signal.signal(signal.SIGTERM, before)


def _next(steps: Sequence[Step], done: set[str], running: Sequence[_Running], lanes: int) -> list[Step]:
    """What may start now: steps whose needs are done, the longest first, as far as there are lanes."""
    busy = {r.step.name for r in running}
    ready = [s for s in steps if s.name not in done | busy and done.issuperset(s.needs)]
    alone = [s for s in ready if s.alone]
    if alone or any(r.step.alone for r in running):
        return alone[:1] if not running else []
    return sorted(ready, key=lambda step: -step.seconds)[: lanes - len(running)]


def _start(step: Step, logs: Path) -> _Running:
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    order = [sys.executable, "-m", step.module, *step.arguments]
    with (logs / f"{step.name}.log").open("w") as output:
        process = subprocess.Popen(order, stdout=output, stderr=output, env=environment, start_new_session=True)
    return _Running(step, process, time.monotonic())


def _finish(found: _Running, logs: Path) -> None:
    name, code = found.step.name, found.process.returncode
    if code or not found.step.made.exists():
        raise RuntimeError(
            f"expected {name} to leave {found.step.made}, but it ended with code {code}: see {logs / name}.log"
        )


class _Display:
    """One bar over all steps with the time left, and a line for each lane; without a terminal, a line a step."""

    def __init__(self, steps: Sequence[Step], lanes: int) -> None:
        self._steps, self._lanes = steps, lanes
        self._began = time.monotonic()
        self._waiting = sum(step.seconds for step in steps if not step.made.exists())
        total = sum(step.seconds for step in steps)
        self._bar = tqdm(total=total, bar_format=BAR, disable=None)
        self._lines = [tqdm(bar_format="  {desc}", position=1 + i, disable=None) for i in range(lanes)]

    def show(self, done: set[str], running: Sequence[_Running], logs: Path) -> None:
        """Bring the bars up to date."""
        now = time.monotonic()
        ended = sum(step.seconds for step in self._steps if step.name in done)
        gone = ended - (self._bar.total - self._waiting)
        # Seconds here for one of the table's, by what ended since the start; 1 until something has.
        pace = (now - self._began) * self._lanes / gone if gone > 0 else 1.0
        under_way = sum(min((now - r.began) / pace, 0.95 * r.step.seconds) for r in running)
        self._bar.n = ended + under_way
        left = pace * (self._bar.total - self._bar.n) / self._lanes if self._bar.total else 0.0
        step = min(len(done) + 1, len(self._steps))
        text = f"step {step} of {len(self._steps)}, about {max(left / 60.0, 1.0):.0f} min left"
        self._bar.set_description_str(text if len(done) < len(self._steps) else "all steps done")
        for i, line in enumerate(self._lines):
            line.set_description_str(_tail(logs, running[i].step.name) if i < len(running) else "")

    def tell(self, name: str, seconds: float) -> None:
        """Say that a step is done."""
        tqdm.write(f"{time.strftime('%H:%M:%S')} {name} done in {seconds:.0f} s", file=sys.stderr)

    def close(self) -> None:
        """Leave the terminal tidy."""
        for bar in (*reversed(self._lines), self._bar):
            bar.close()


def _tail(logs: Path, name: str) -> str:
    """The last line of a step's log, which is its bar."""
    path = logs / f"{name}.log"
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - TAIL_BYTES, 0))
        lines = file.read().decode(errors="replace").replace("\r", "\n").strip().splitlines()
    return f"{name}: {lines[-1][:100] if lines else ''}"
