"""Memory and processor time of a family of processes."""

import os
import subprocess
import sys

import psutil

from shipshape.processes import Processes

MIB = 2**20
BUSY = """
import sys
block = bytearray(b"x" * (64 << 20))
sum(range(10_000_000))
print("busy", flush=True)
sys.stdin.read()
"""


def told(processes):
    return {sample.name: sample.value for metric in processes.collect() for sample in metric.samples}


def test_all_processes_count_as_one_also_after_their_end():
    processes = Processes()
    alone = told(processes)
    with subprocess.Popen([sys.executable, "-c", BUSY], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout.readline() == b"busy\n"
        spent = sum(psutil.Process(child.pid).cpu_times()[:2])
        together = told(processes)
        child.stdin.close()
    after = told(processes)
    assert together["shipshape_memory_bytes"] >= alone["shipshape_memory_bytes"] + 64 * MIB
    assert after["shipshape_memory_bytes"] <= together["shipshape_memory_bytes"] - 64 * MIB
    assert together["shipshape_cpu_seconds_total"] >= alone["shipshape_cpu_seconds_total"] + spent > 0
    assert after["shipshape_cpu_seconds_total"] >= together["shipshape_cpu_seconds_total"]


def test_pages_that_are_shared_count_once():
    block = bytearray(os.urandom(64 * MIB))
    before = told(Processes())["shipshape_memory_bytes"]
    ready, done = os.pipe(), os.pipe()
    if (pid := os.fork()) == 0:
        os.write(ready[1], bytes([block[0]]))
        os.read(done[0], 1)
        os._exit(0)
    os.read(ready[0], 1)
    assert told(Processes())["shipshape_memory_bytes"] < before + 32 * MIB
    os.write(done[1], b"x")
    os.waitpid(pid, 0)
    for end in (*ready, *done):
        os.close(end)
