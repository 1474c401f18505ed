"""The shipped bundle on clusters that never change: right, and the same as when its answers were written down.

A change of answers is not always wrong, but it is always news: run make_golden.py and read the diff.
"""

import json
import math
from functools import cache
from typing import Any

import make_golden
import pytest

from builders import heading_error_deg
from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.types import Options, Preset, Recognition

COUNT = 10
trained = pytest.mark.skipif(
    not (make_golden.BUNDLE / "manifest.toml").exists(), reason="there is no trained bundle in models/ yet"
)
each_cluster = pytest.mark.parametrize("index", range(COUNT))


@cache
def written() -> dict[str, Any]:
    if not make_golden.ANSWERS.exists():
        pytest.fail("expected tests/golden/answers.json beside a trained bundle: run tests/golden/make_golden.py")
    return json.loads(make_golden.ANSWERS.read_text())


@cache
def pipeline() -> Pipeline:
    return Pipeline(load_bundle(make_golden.BUNDLE))


@cache
def recognised(preset: Preset, index: int) -> Recognition:
    _, _, contact = make_golden.golden_contacts()[index]
    return pipeline().run(contact, Options(preset))


def test_golden_clusters_are_those_that_were_chosen() -> None:
    golden = make_golden.golden_contacts()

    assert len(golden) == COUNT
    assert len({vessel for vessel, _, _ in golden}) == COUNT // 2
    assert all(len(contact.points_level) >= make_golden.FEWEST_POINTS for _, _, contact in golden)
    assert all(-math.pi < heading <= math.pi for _, heading, _ in golden)


@trained
@each_cluster
def test_best_knows_the_vessel_and_where_its_bow_points(index: int) -> None:
    vessel, heading, _ = make_golden.golden_contacts()[index]
    said = recognised(Preset.BEST, index)

    assert (said.vessel, said.unknown) == (vessel, False)
    assert heading_error_deg(said.heading, heading) < 5.0


@trained
@each_cluster
@pytest.mark.parametrize("preset", list(Preset))
def test_answers_are_those_written_down(preset: Preset, index: int) -> None:
    was, said = written()[preset][index], recognised(preset, index)

    made_with = f"answers.json was written with bundle {written()['bundle'][:12]}, this is {said.bundle[:12]}"
    assert said.vessel == was["vessel"], made_with
    assert heading_error_deg(said.heading, math.radians(was["heading_deg"])) < 0.7, made_with
    assert said.probability == pytest.approx(was["probability"], abs=0.05), made_with
    assert said.bow_probability == pytest.approx(was["bow_probability"], abs=0.05), made_with
    assert said.box.center_level == pytest.approx(was["center"], abs=0.1), made_with
    size = said.box.size
    assert (size.length, size.beam, size.height) == pytest.approx(was["size"], rel=0.01), made_with
