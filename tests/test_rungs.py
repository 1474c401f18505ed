"""The ladder of the pipeline: what each rung leaves out, and that work can change over half-way."""

from itertools import takewhile

import numpy as np
import pytest

from shipshape.render import render_png
from shipshape.types import Options, Preset, Recognition, Rung
from test_pipeline import BEST, cluster, pipeline

LOWER = [Rung.WITHOUT_RESTORATION, Rung.HEADING_AND_BOX]


def on_rung(rung: Rung, *, half_way: bool = False) -> Recognition:
    ladder = {one.name: one.stages for one in pipeline().ladder(BEST)}
    stages = list(ladder[rung])
    if half_way:  # as the executor does it: the first stages are those of the full answer
        pairs = zip(stages, ladder[Rung.FULL], strict=False)
        shared = [full for one, full in takewhile(lambda pair: pair[0] is pair[1], pairs)]
        assert shared
        stages[: len(shared)] = shared
    work = pipeline().begin(cluster(), BEST)
    for stage in stages:
        stage.run(work)
    return pipeline().finish(work, {}, rung, "time was short" if rung is not Rung.FULL else "")


@pytest.mark.parametrize("rung", LOWER)
def test_a_lower_rung_says_all_but_what_is_restored(rung: Rung) -> None:
    said = on_rung(rung)
    assert sum(said.probabilities.values()) == pytest.approx(1.0, abs=1e-5)
    assert said.heading_std > 0.0
    assert said.box.size.length > 0.0
    assert (said.rung, said.rung_reason) == (rung, "time was short")
    assert said.images is None
    assert len(said.descriptors) == 0
    assert len(said.keypoints_level) == said.inferred_points == 0
    np.testing.assert_array_equal(said.restored.points_level, cluster().points_level)
    assert "occluded" not in said.reasons


def test_without_restoration_heading_and_box_are_those_of_the_full_answer() -> None:
    full, lower = on_rung(Rung.FULL), on_rung(Rung.WITHOUT_RESTORATION)
    assert (lower.heading, lower.heading_std, lower.box, lower.bow_probability) == (
        full.heading,
        full.heading_std,
        full.box,
        full.bow_probability,
    )


@pytest.mark.parametrize("rung", LOWER)
def test_changing_over_half_way_gives_the_same_answer(rung: Rung) -> None:
    at_once, later = on_rung(rung), on_rung(rung, half_way=True)
    assert at_once.probabilities == later.probabilities
    assert (at_once.heading, at_once.box) == (later.heading, later.box)


def test_each_rung_begins_like_the_one_above_and_is_shorter() -> None:
    full, middle, least = pipeline().ladder(BEST)
    assert middle.stages[:3] == full.stages[:3]
    assert least.stages[0] is full.stages[0]
    assert len(full.stages) > len(middle.stages) >= len(least.stages)
    assert [rung.name for rung in (full, middle, least)] == list(Rung)


@pytest.mark.parametrize(
    ("lowest", "count"), [(Rung.FULL, 1), (Rung.WITHOUT_RESTORATION, 2), (Rung.HEADING_AND_BOX, 3)]
)
def test_the_caller_says_how_low(lowest: Rung, count: int) -> None:
    assert len(pipeline().ladder(Options(lowest_rung=lowest))) == count


def test_the_papers_method_is_never_cut_short() -> None:
    (rung,) = pipeline().ladder(Options(Preset.PAPER))
    assert rung.name is Rung.FULL


@pytest.mark.parametrize("rung", LOWER)
def test_a_lower_rung_can_be_drawn(rung: Rung) -> None:
    assert render_png(cluster(), on_rung(rung)).startswith(b"\x89PNG")
