import gc
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipshape.executor.costs import MEMORY, Costs


class Thing:
    pass


def test_what_was_never_timed_costs_nothing():
    assert Costs().of(Thing(), 100) == 0


@given(base=st.floats(1e-4, 1e-2), slope=st.floats(0, 1e-5), seed=st.integers(0, 2**32))
def test_a_line_is_found(base, slope, seed):
    costs, stage, source = Costs(), Thing(), random.Random(seed)
    for _ in range(3 * MEMORY):
        size = source.uniform(10, 2000)
        costs.learn(stage, size, base + slope * size)
    for size in (10, 300, 2000):
        assert costs.of(stage, size) == pytest.approx(base + slope * size, rel=0.02)


def test_one_size_alone_says_nothing_of_a_slope():
    costs, stage = Costs(), Thing()
    for _ in range(10):
        costs.learn(stage, 300, 0.002)
    assert costs.of(stage, 10_000) == pytest.approx(0.002)


def test_it_is_never_negative_nor_cheaper_for_more():
    costs, stage = Costs(), Thing()
    for size, seconds in [(10, 0.004), (1000, 0.001)] * 50:
        costs.learn(stage, size, seconds)
    assert costs.of(stage, 10) == costs.of(stage, 1000) > 0


def test_a_machine_that_became_slower_is_soon_known():
    costs, stage = Costs(), Thing()
    for seconds in [0.001] * 1000 + [0.003] * 2 * MEMORY:
        costs.learn(stage, 300, seconds)
    assert costs.of(stage, 300) == pytest.approx(0.003, rel=0.05)


def test_one_stall_is_no_new_cost_but_many_are():
    costs, stage = Costs(), Thing()
    for seconds in [0.001] * 20 + [10.0]:
        costs.learn(stage, 300, seconds)
    assert costs.of(stage, 300) < 0.002
    for _ in range(MEMORY):
        costs.learn(stage, 300, 0.1)
    assert costs.of(stage, 300) == pytest.approx(0.1, rel=0.4)


def test_stages_that_are_gone_are_forgotten():
    costs, stage = Costs(), Thing()
    costs.learn(stage, 300, 0.001)
    del stage
    gc.collect()
    assert len(costs._lines) == 0
