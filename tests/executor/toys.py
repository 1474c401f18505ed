"""What worker processes do in the tests of the crew: stages that do what their order says."""

import os
import signal
import time
from pathlib import Path

from shipshape.errors import Unprocessable
from shipshape.executor import Costs, Lane, Prepared, Task

STAGE_S = 0.3  # of a slow stage


class Toy:
    def __init__(self, name):
        self.name = name

    def run(self, work):
        action = work["do"].get(self.name)
        work["seen"].append(self.name)
        if "touch" in work["do"]:
            Path(work["do"]["touch"]).touch()
        if action == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        elif action == "hang":
            time.sleep(3600)
        elif action == "raise":
            raise ValueError(f"planned in {self.name}")
        elif action == "slow":
            time.sleep(STAGE_S)


class Rung:
    def __init__(self, name, stages):
        self.name, self.stages = name, stages


FIRST, SECOND = Toy("first"), Toy("second")
LADDER = [Rung("full", (FIRST, SECOND)), Rung("less", (FIRST,))]


def make(order, deadline):
    if order.get("refuse"):
        raise Unprocessable("expected a toy, got a doll")
    work = {"do": order, "seen": []}
    return Task(LADDER, work, finish, deadline, Lane(order.get("lane", "tracking")))


def finish(work, ended):
    if work["do"].get("first") == "unspeakable":
        return lambda: None
    return {
        "seen": work["seen"],
        "rung": ended.rung,
        "process": os.getpid(),
        "size": len(work["do"].get("load", b"")),
    }


def prepare(loaded, what=""):
    if what == "refuse":
        raise Unprocessable("expected something to prepare, got nothing")
    if what == "die":
        os._exit(3)
    if what.startswith("once:"):
        Path(what.removeprefix("once:")).touch(exist_ok=False)
    loaded()
    if what == "slow":
        time.sleep(3600)
    return Prepared({"prepared": what}, make, Costs())
