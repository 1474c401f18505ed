"""The shipped networks with micro-batches forced on: a contact's answer does not depend on whom it met.

Where this was written answers are equal to the last bit; TOLERANCE leaves room for processors whose kernels add
up in another order for another number of rows.
"""

import random
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from builders import random_points
from builders_onnx import doubling_onnx
from shipshape.bundle import Bundle, load_bundle
from shipshape.errors import BundleError, Cancelled, DeadlineExceeded
from shipshape.executor import Executor, Task
from shipshape.first_look import CENTRES, filled_up, network_inputs
from shipshape.onnx_model import OnnxModel
from shipshape.pipeline import Pipeline
from shipshape.pointfiles import read_clusters
from shipshape.providers import Runtime
from shipshape.sight import SightFrame
from shipshape.types import Contact, ImageMethod, Options, Preset, Recognition

ROOT = Path(__file__).parents[1]
FORCED = Runtime(micro_batches="on")
TOLERANCE = 1e-4
THREADS = 16
WISHES = [Options(), *(Options(Preset.PAPER, method) for method in ImageMethod)]
NETWORKS = sorted(path.stem for path in (ROOT / "models").glob("*.onnx"))
trained = pytest.mark.skipif(
    not (ROOT / "models/manifest.toml").exists(), reason="there is no trained bundle in models/ yet"
)


@cache
def bundle(runtime: Runtime = FORCED) -> Bundle:
    return load_bundle(ROOT / "models", runtime)


@cache
def contacts() -> list[Contact]:
    """Some of many points, and as many of few, whose groups have to be filled up."""
    full = read_clusters(ROOT / "examples/contacts.npz")
    rng = np.random.default_rng(3)
    thin = [points[np.sort(rng.choice(len(points), 10 + 9 * index))] for index, points in enumerate(full)]
    return [Contact(points, sensor_height=3.0) for points in (*full, *thin)]


@cache
def alone(index: int, options: Options) -> Recognition:
    """What the pipeline says when nothing is shared."""
    return Pipeline(bundle(Runtime())).run(contacts()[index], options)


def same(found: Recognition, wanted: Recognition) -> None:
    assert (found.vessel, found.unknown, found.reasons) == (wanted.vessel, wanted.unknown, wanted.reasons)
    assert found.probabilities == pytest.approx(wanted.probabilities, abs=TOLERANCE)
    assert found.heading == pytest.approx(wanted.heading, abs=TOLERANCE)
    assert found.bow_probability == pytest.approx(wanted.bow_probability, abs=TOLERANCE)
    assert found.restored.points_level.shape == wanted.restored.points_level.shape
    np.testing.assert_allclose(found.restored.points_level, wanted.restored.points_level, rtol=0, atol=TOLERANCE)


@trained
@pytest.mark.parametrize("name", NETWORKS)
def test_rows_of_a_padded_run_are_those_of_single_runs(name: str) -> None:
    single, shared = bundle(Runtime()).models[name], bundle().models[name]
    rng = np.random.default_rng(5)
    free = {"near": CENTRES[0], "members": 16 * CENTRES[1], "far": CENTRES[1], "centres": CENTRES[1]}
    inputs = {
        spec.name: (rng.random((11, *(free.get(spec.name) if side < 0 else side for side in spec.shape[1:]))) * 2)
        .astype(np.float32)
        .astype(spec.dtype)
        for spec in single.signature.inputs
    }
    together = shared.run(**inputs)
    assert shared.most_rows == 32
    for row in range(11):
        one = single.run(**{name: array[row : row + 1] for name, array in inputs.items()})
        for whole, wanted in zip(together, one, strict=True):
            assert whole.shape[0] == 11, "the padding is not handed out"
            np.testing.assert_allclose(whole[row], wanted[0], rtol=TOLERANCE, atol=TOLERANCE)


@trained
@pytest.mark.parametrize("points", [1, 20, CENTRES[1], 100, CENTRES[0], 600])
def test_groups_that_come_twice_change_nothing(points: int) -> None:
    inputs = network_inputs(random_points(points, seed=2, spread=8.0), SightFrame(0.1, (30.0, 4.0, -3.0), True))
    filled = filled_up(inputs)
    shapes = {name: array.shape for name, array in filled.items()}
    largest = network_inputs(random_points(600, seed=1, spread=8.0), SightFrame(0.0, (30.0, 4.0, -3.0), True))
    assert shapes == {name: array.shape for name, array in largest.items()}
    model = bundle(Runtime()).models["points"]
    found, wanted = (model.run(**{name: a[None] for name, a in given.items()}) for given in (filled, inputs))
    for left, right in zip(found, wanted, strict=True):
        np.testing.assert_allclose(left, right, rtol=TOLERANCE, atol=TOLERANCE)


@trained
@pytest.mark.parametrize("options", WISHES, ids=lambda options: f"{options.preset}-{options.image_method}")
def test_contacts_that_meet_are_answered_as_alone(options: Options) -> None:
    pipeline = Pipeline(bundle())
    turns = [*range(len(contacts()))] * 3
    random.Random(7).shuffle(turns)
    with ThreadPoolExecutor(THREADS) as threads:
        found = list(threads.map(lambda index: pipeline.run(contacts()[index], options), turns))
    for index, recognition in zip(turns, found, strict=True):
        same(recognition, alone(index, options))


@trained
def test_contacts_of_callers_who_leave_or_are_late_take_nothing_from_the_others() -> None:
    pipeline = Pipeline(bundle())
    executor = Executor(THREADS, queue_limit=512)
    rng = random.Random(11)

    def task(index: int, deadline: float) -> Task:
        return Task(
            pipeline.ladder(WISHES[0])[:1],
            pipeline.begin(contacts()[index], WISHES[0]),
            lambda work, ended: pipeline.finish(work, ended.stage_ms),
            deadline,
        )

    late, leaves = 1, 2
    tickets = []
    for turn in range(120):
        index, fate = turn % len(contacts()), rng.choice([0, 0, late, leaves])
        deadline = executor.clock() + (rng.uniform(0.0, 0.02) if fate == late else 600.0)
        try:
            tickets.append((index, fate, executor.submit(task(index, deadline))))
        except DeadlineExceeded:
            assert fate == late
    for _, fate, ticket in tickets:
        if fate == leaves:
            ticket.cancel()
    for index, fate, ticket in tickets:
        try:
            same(ticket.result(), alone(index, WISHES[0]))
        except (Cancelled, DeadlineExceeded):
            assert fate != 0
    assert executor.stop(60.0)


def test_a_network_that_takes_one_image_only_is_not_batched() -> None:
    onnx = pytest.importorskip("onnx")
    model = onnx.load_from_string(doubling_onnx())
    model.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 1
    fixed = OnnxModel(model.SerializeToString(), runtime=FORCED)
    x = np.ones((1, 3), np.float32)
    np.testing.assert_array_equal(fixed.run(x=x)[0], 2 * x)
    assert fixed.most_rows == 1


def test_wrong_inputs_are_told_as_without_batches() -> None:
    model = OnnxModel(doubling_onnx(), label="prior.onnx", runtime=FORCED)
    model.run(x=np.ones((2, 3), np.float32))
    with pytest.raises(BundleError, match=r"expected prior\.onnx to take x float32\[2, 4\]"):
        model.run(x=np.zeros((2, 4), np.float32))
    assert model.most_rows == 32


@pytest.mark.parametrize(
    ("runtime", "most"), [(Runtime(), 1), (Runtime(micro_batches="on", buckets=(1, 2)), 2), (FORCED, 32)]
)
def test_runs_are_shared_only_where_it_is_said(runtime: Runtime, most: int) -> None:
    assert OnnxModel(doubling_onnx(), runtime=runtime).most_rows == most
