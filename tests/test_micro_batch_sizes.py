"""How many rows a network is given at once: by what its first call measures, and by what it can take."""

import numpy as np
import pytest

from builders_batches import POISON, Network, right, rows
from shipshape.micro_batches import BUCKETS, Arrays, MicroBatches


def test_the_first_call_runs_every_bucket_once() -> None:
    network = Network()
    right(MicroBatches(network).run(rows(1.0, 2.0, 3.0)), rows(1.0, 2.0, 3.0))
    assert network.sizes == [*BUCKETS, 4], "three rows are padded"


@pytest.mark.parametrize(
    "inputs",
    [
        {"x": np.zeros((2, 3), np.float32), "y": np.zeros((1, 3), np.float32)},
        {"x": np.float32(1.0)},
        {"x": np.zeros((0, 3), np.float32)},
        {},
    ],
    ids=["rows that disagree", "no dimension", "no row", "nothing"],
)
def test_inputs_without_rows_go_to_the_network_as_they_are(inputs: dict[str, np.ndarray]) -> None:
    seen = []
    batches = MicroBatches(lambda given: seen.append(given) or [])
    assert batches.run(inputs) == []
    assert seen == [inputs]


def test_bad_inputs_of_the_first_call_are_its_own_fault() -> None:
    network = Network()
    batches = MicroBatches(network)
    with pytest.raises(ValueError, match="poison"):
        batches.run(rows(POISON))
    right(batches.run(rows(1.0)), rows(1.0))
    assert batches.largest == BUCKETS[-1]


def test_a_network_without_an_answer_for_each_row_is_left_alone() -> None:
    batches = MicroBatches(lambda inputs: [inputs["x"].sum(axis=0)])
    np.testing.assert_array_equal(batches.run(rows(1.0, 2.0))[0], [3.0, 3.0, 3.0])
    assert batches.largest == 1


def test_a_device_that_has_no_memory_for_a_bucket_is_spared_it() -> None:
    def network(inputs: Arrays) -> list[np.ndarray]:
        if len(inputs["x"]) > 8:
            raise MemoryError("no room for so many")
        return [inputs["x"]]

    batches = MicroBatches(network)
    batches.run(rows(1.0))
    assert batches.largest == 8


@pytest.mark.parametrize(
    ("fixed", "each", "largest"),
    [(0.0, 1.0, 1), (0.3, 1.0, 1), (1.0, 0.0, 32), (1.0, 0.1, 8), (1.0, 0.01, 32)],
    ids=["processor", "processor, small network", "idle card", "card that fills", "card with room"],
)
def test_buckets_are_used_as_far_as_they_are_measured_to_pay(fixed: float, each: float, largest: int) -> None:
    now = [0.0]

    def network(inputs: Arrays) -> list[np.ndarray]:
        now[0] += fixed + each * len(inputs["x"])
        return [inputs["x"]]

    batches = MicroBatches(network, measured=True, clock=lambda: now[0])
    batches.run(rows(1.0))
    assert batches.largest == largest


def test_one_slow_measurement_decides_nothing() -> None:
    now, delays = [0.0], iter([0.0, 50.0, 0.0, 0.0, 0.0, 0.0])

    def network(inputs: Arrays) -> list[np.ndarray]:
        now[0] += len(inputs["x"]) + next(delays, 0.0)
        return [inputs["x"]]

    batches = MicroBatches(network, measured=True, clock=lambda: now[0])
    batches.run(rows(1.0))
    assert batches.largest == 1
