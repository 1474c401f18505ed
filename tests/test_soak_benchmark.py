"""When the soak calls memory growing: the one thing of it that a short run would not show."""

import numpy as np
import pytest

from benchmarks.soak import slope_of

SECONDS = np.arange(0, 1800, 10.0)


def noise(seed, alike=0.0):
    """Of a standard deviation of 1, each sample like the one before it by so much."""
    rng, values = np.random.default_rng(seed), [0.0]
    for step in rng.normal(0, np.sqrt(1 - alike**2), len(SECONDS)):
        values.append(alike * values[-1] + step)
    return np.array(values[1:])


def test_a_steady_slope_is_found():
    found = slope_of(SECONDS, 300 + 10 * SECONDS / 3600 + 0.1 * noise(0))
    assert found.low < 10 < found.high
    assert found.high - found.low < 1
    assert found.grows


@pytest.mark.parametrize("alike", [0.0, 0.9])
def test_noise_alone_is_rarely_called_growth(alike):
    grown = sum(slope_of(SECONDS, 300 + noise(seed, alike)).grows for seed in range(400))
    assert grown < 0.07 * 400, "the interval holds 95 %, and growth is one side of what is outside"


def test_memory_that_never_moves_does_not_grow():
    found = slope_of(SECONDS, np.full(len(SECONDS), 300.0))
    assert (found.an_hour, found.grows) == (0, False)


def test_a_few_new_pages_are_no_growth():
    found = slope_of(SECONDS, 300 + 0.004 * np.floor(SECONDS / 120))
    assert found.low > 0
    assert not found.grows
