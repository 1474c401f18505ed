"""How kernels are kept on disk, in a process of their own: what is compiled is compiled once a process."""

import os
import subprocess
import sys

PROGRAM = """
import resource
import numpy as np
from shipshape import kernels
resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most}))
points = np.ones((4, 3), np.float32)
print(kernels.extent(points, 0.0).mean.tolist())
kernels.missing_share(points, np.ones(4, np.bool_), 0.0, 0.0, 4)
"""


def ran(folder, most):
    """The program with kernels kept in `folder`, where no file may have more bytes than `most`."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
    words = [sys.executable, "-c", PROGRAM.format(most=most)]
    run = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    assert run.stdout == "[1.0, 1.0, 1.0]\n", run.stderr
    return run.stderr


def test_a_full_disk_costs_the_next_start_seconds_and_not_this_one_its_life(tmp_path):
    assert ran(tmp_path, 0).count("compiled kernels are not kept") == 1
    assert not list(tmp_path.rglob("*.nbc"))
    assert ran(tmp_path, -1) == ""
    assert list(tmp_path.rglob("clouds.extent-*.nbc"))
