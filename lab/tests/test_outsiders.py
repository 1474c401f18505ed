import numpy as np
import pytest

from shipshape_lab.simulator.outsiders import OUTSIDER_TYPES, Outsider
from shipshape_lab.simulator.strangers import STRANGER_TYPES
from shipshape_lab.simulator.vessels import VESSEL_TYPES

SEEDS = (None, *range(2000, 2006))


@pytest.mark.parametrize("name", OUTSIDER_TYPES)
def test_outsiders_stand_on_the_water_with_their_longer_side_along_x(name):
    for seed in SEEDS:
        vessel = Outsider(name).build(seed)
        low, high = vessel.mesh.bounds
        assert (vessel.name, vessel.seed) == (name, seed)
        assert low[2] == pytest.approx(0.0, abs=1e-9)
        assert low[:2] + high[:2] == pytest.approx([0.0, 0.0], abs=1e-6)
        assert high[0] - low[0] >= high[1] - low[1] - 1e-9
        assert 1.0 < high[0] - low[0] < 60.0


@pytest.mark.parametrize("name", OUTSIDER_TYPES)
def test_the_same_seed_gives_the_same_outsider_and_another_one_another(name):
    one, again, other = (Outsider(name).build(seed).mesh for seed in (3, 3, 4))
    assert np.array_equal(one.vertices, again.vertices)
    assert one.vertices.shape != other.vertices.shape or not np.allclose(one.vertices, other.vertices)


def test_outsiders_are_of_no_kind_that_trains_a_model():
    assert not set(OUTSIDER_TYPES) & {*VESSEL_TYPES, *STRANGER_TYPES}
