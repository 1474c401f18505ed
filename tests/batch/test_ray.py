"""Ray Data on a local cluster of two nodes gives the rows that this machine would compute itself."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from batch.written import write_inputs
from shipshape.cli import main

pytest.importorskip("ray", reason="ray is not installed: the extra shipshape[ray]")
MODELS = Path(__file__).parents[2] / "models"
pytestmark = pytest.mark.skipif(
    not (MODELS / "manifest.toml").exists(), reason="the default bundle (models/) is not trained yet"
)

# In a process of its own: Ray leaves threads, sockets and environment variables behind.
TWO_NODES = """
import sys
from ray.cluster_utils import Cluster
from shipshape.batch import reading
from shipshape.cli import main

cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "object_store_memory": 2**27})
cluster.add_node(num_cpus=1, object_store_memory=2**27)
cluster.wait_for_nodes()
assert len(cluster.list_all_nodes()) == 2
try:
    code = main([*sys.argv[1:], "--ray", cluster.address])
finally:
    import ray
    ray.shutdown()
    cluster.shutdown()
sys.exit(code)
"""


def test_nobody_there_is_told(tmp_path, capsys):
    (tmp_path / "a.npy").touch()
    with socket.socket() as bound:  # nobody listens on it
        bound.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{bound.getsockname()[1]}"
        given = ["batch", str(tmp_path / "a.npy"), "--out", str(tmp_path / "out"), "--bundle", str(MODELS)]
        assert main([*given, "--ray", address]) == 2
    sentence = f"expected a Ray cluster at {address}, got ConnectionRefusedError"
    assert capsys.readouterr().err == f"shipshape: {sentence}\n"


def test_two_nodes_give_the_same_bytes(tmp_path):
    inputs = write_inputs(tmp_path / "inputs", messages=6, clusters=6)
    common = ["batch", str(inputs), "--bundle", str(MODELS), "--restored"]
    quiet = {**os.environ, "RAY_USAGE_STATS_ENABLED": "0", "RAY_DISABLE_MEMORY_MONITOR": "1"}
    assert main([*common, "--workers", "1", "--out", str(tmp_path / "here")]) == 1  # one input is damaged
    there = [sys.executable, "-c", TWO_NODES, *common, "--out", str(tmp_path / "there")]
    ran = subprocess.run(there, env=quiet, capture_output=True, text=True, check=False, timeout=280)
    assert ran.returncode == 1, ran.stderr[-3000:]
    assert (tmp_path / "there/contacts.parquet").read_bytes() == (tmp_path / "here/contacts.parquet").read_bytes()
    assert pq.read_table(tmp_path / "there/clouds").num_rows == 11
