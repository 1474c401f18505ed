import numpy as np
import pytest

from shipshape_lab.simulator.strangers import LENGTHS, STRANGER_TYPES, build_stranger
from shipshape_lab.simulator.vessels import VESSEL_TYPES

SEEDS = range(25)


@pytest.mark.parametrize("name", STRANGER_TYPES)
def test_strangers_lie_in_the_vessel_frame_with_their_longer_side_along_x(name):
    for seed in SEEDS:
        low, high = build_stranger(name, seed).mesh.bounds
        assert low[2] >= 0.0
        assert low[:2] + high[:2] == pytest.approx([0.0, 0.0], abs=1e-6)
        assert LENGTHS[0] <= high[0] - low[0] <= LENGTHS[1]
        assert high[2] > 0.0


def test_a_stray_thing_is_never_broader_than_long():
    for seed in SEEDS:
        length, beam, _ = build_stranger("stray_thing", seed).box
        assert beam <= length + 1e-6


@pytest.mark.parametrize("name", STRANGER_TYPES)
def test_the_same_seed_gives_the_same_stranger_and_another_one_another(name):
    one, again, other = (build_stranger(name, seed).mesh for seed in (3, 3, 4))
    assert np.array_equal(one.vertices, again.vertices)
    assert one.vertices.shape != other.vertices.shape or not np.allclose(one.vertices, other.vertices)


def test_another_name_is_refused_with_those_that_exist():
    with pytest.raises(ValueError, match="stray_hull, stray_thing"):
        build_stranger(VESSEL_TYPES[0], 1)
