import os

from shipshape.executor import usable_cores

HERE = len(os.sched_getaffinity(0))


def test_no_cgroup_leaves_the_affinity_mask(tmp_path):
    assert usable_cores(tmp_path) == HERE


def test_quota_of_cgroup_2(tmp_path):
    (tmp_path / "cpu.max").write_text("150000 100000\n")
    assert usable_cores(tmp_path) == 1


def test_no_quota_in_cgroup_2(tmp_path):
    (tmp_path / "cpu.max").write_text("max 100000\n")
    assert usable_cores(tmp_path) == HERE


def test_less_than_a_core_is_still_one_worker(tmp_path):
    (tmp_path / "cpu.max").write_text("20000 100000\n")
    assert usable_cores(tmp_path) == 1


def test_quota_of_cgroup_1(tmp_path):
    (tmp_path / "cpu").mkdir()
    (tmp_path / "cpu/cpu.cfs_quota_us").write_text("100000")
    (tmp_path / "cpu/cpu.cfs_period_us").write_text("100000")
    assert usable_cores(tmp_path) == 1
    (tmp_path / "cpu/cpu.cfs_quota_us").write_text("-1")
    assert usable_cores(tmp_path) == HERE
