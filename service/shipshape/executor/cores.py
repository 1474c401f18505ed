"""How many cores this process may use: the affinity mask and the cgroup quota, not the host's count."""

import math
import os
from pathlib import Path

CGROUP = Path("/sys/fs/cgroup")


def usable_cores(cgroup: Path = CGROUP) -> int:
    """Cores that the affinity mask and the cgroup's CPU quota leave to this process, at least 1.

    Args:
        cgroup: Root of the cgroup file system (version 1 or 2).
    """
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = _quota_v2(cgroup) or _quota_v1(cgroup) or math.inf
    return max(1, min(allowed, math.floor(min(quota, allowed))))


def _quota_v2(cgroup: Path) -> float | None:
    text = _read(cgroup / "cpu.max").split()
    return int(text[0]) / int(text[1]) if len(text) == 2 and text[0] != "max" else None


def _quota_v1(cgroup: Path) -> float | None:
    quota, period = _read(cgroup / "cpu/cpu.cfs_quota_us"), _read(cgroup / "cpu/cpu.cfs_period_us")
    return int(quota) / int(period) if quota and period and int(quota) > 0 else None


def _read(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:  # no such controller here: no limit
        return ""
