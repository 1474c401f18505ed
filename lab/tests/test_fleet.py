"""The steps of a fleet's run, with small processes in place of training."""

import argparse
import json
from pathlib import Path

import numpy as np
import pytest
from hulls import box_hull
from untrained import write_untrained

from shipshape_lab.experiments import real_catalogue
from shipshape_lab.experiments.pages import real_catalogue as page
from shipshape_lab.fleet import command, evaluate, runner, scans
from shipshape_lab.fleet.plan import FULL, QUICK
from shipshape_lab.fleet.report import write_report
from shipshape_lab.fleet.steps import SECONDS, Order, Step, steps_of
from shipshape_lab.simulator import recipes
from shipshape_lab.simulator.catalogue import DEFAULT, Catalogue, read_catalogue

TOML = '[[vessel]]\nname = "barge"\nmesh = "barge.stl"\n\n[[vessel]]\nname = "tug"\ntype = "tug"\n'


@pytest.fixture
def order(tmp_path):
    box_hull().mesh.export(tmp_path / "barge.stl")
    (tmp_path / "fleet.toml").write_text(TOML)
    return Order(tmp_path / "fleet.toml", tmp_path / "to", tmp_path / "work", QUICK, 2, tmp_path / "start")


def step(folder, name, needs=(), code="", **more):
    """A process that leaves a file, or does what `code` says."""
    script = folder / f"step_{name}.py"
    body = code or f"import pathlib; pathlib.Path({str(folder / name)!r}).write_text('made')"
    script.write_text(body)
    return Step(name, script.stem, (), folder / name, 10.0, needs, **more)


@pytest.fixture(autouse=True)
def steps_can_be_found(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))


def test_steps_run_in_the_order_of_their_needs(tmp_path):
    first, last = tmp_path / "first", tmp_path / "last"
    needy = f"import pathlib; assert pathlib.Path({str(first)!r}).exists(); pathlib.Path({str(last)!r}).touch()"
    steps = [step(tmp_path, "last", ("first",), needy), step(tmp_path, "first")]
    runner.run_steps(steps, lanes=2, logs=tmp_path / "logs")
    assert last.exists()


def test_what_is_made_is_not_made_again(tmp_path):
    (tmp_path / "done").touch()
    broken = step(tmp_path, "done", code="raise SystemExit(9)")
    runner.run_steps([broken, step(tmp_path, "other", ("done",))], lanes=1, logs=tmp_path / "logs")
    assert (tmp_path / "other").read_text() == "made"


def test_a_step_that_fails_names_its_log_and_stops_the_others(tmp_path):
    slow = step(tmp_path, "slow", code="import time; time.sleep(60)")
    broken = step(tmp_path, "broken", code="raise SystemExit('no hulls')")
    with pytest.raises(RuntimeError, match=r"expected broken to leave .* code 1: see .*broken\.log"):
        runner.run_steps([slow, broken], lanes=2, logs=tmp_path / "logs")
    assert "no hulls" in (tmp_path / "logs/broken.log").read_text()
    assert not (tmp_path / "slow").exists()


def test_a_step_that_leaves_nothing_has_failed(tmp_path):
    with pytest.raises(RuntimeError, match="ended with code 0"):
        runner.run_steps([step(tmp_path, "empty", code="pass")], lanes=1, logs=tmp_path / "logs")


def test_a_step_that_uses_every_lane_runs_alone(tmp_path):
    steps = [step(tmp_path, name, alone=name == "wide") for name in ("a", "wide")]
    assert [s.name for s in runner._next(steps, set(), [], 2)] == ["wide"]
    assert [s.name for s in runner._next(steps, {"wide"}, [], 2)] == ["a"]


@pytest.mark.parametrize("plan", [QUICK, FULL])
def test_every_step_comes_after_what_it_needs_and_has_a_length(order, plan):
    steps = steps_of(Order(order.catalogue, order.bundle, order.work, plan, 2, order.start))
    seen = set()
    for one in steps:
        assert seen.issuperset(one.needs)
        assert one.seconds > 0
        seen.add(one.name)
    assert ("start" in seen) == plan.starts_from_bundle
    assert {"train", "inpainting_full_top", "spd2_z_side", "bundle", "evaluation"} <= seen
    assert len({one.made for one in steps}) == len(steps)


def test_the_plans_keep_their_promise():
    lengths = [[s.seconds for s in steps_of(Order(*map(Path, "ctw"), plan, 2, Path()))] for plan in (FULL, QUICK)]
    full, quick = (sum(length) / 2 / 60 for length in lengths)
    assert full < 180
    assert quick < 20
    assert set(SECONDS) >= set(QUICK.epochs)


def test_a_folder_is_of_one_catalogue(order):
    catalogue = read_catalogue(order.catalogue)
    command._claim(order, catalogue)
    command._claim(order, catalogue)
    full = Order(order.catalogue, order.bundle, order.work, FULL, 2, order.start)
    with pytest.raises(ValueError, match="one of them changed"):
        command._claim(full, catalogue)
    box_hull(12.0).mesh.export(order.catalogue.with_name("barge.stl"))
    with pytest.raises(ValueError, match="one of them changed"):
        command._claim(order, catalogue)


def test_a_bundle_of_someone_else_is_left_alone(order):
    order.bundle.mkdir()
    (order.bundle / "manifest.toml").write_text("format = 1\n")
    with pytest.raises(ValueError, match="expected no bundle in"):
        command._claim(order, read_catalogue(order.catalogue))


def test_a_quick_run_needs_a_bundle_to_start_from(order):
    args = argparse.Namespace(work=None, to=order.bundle, quick=True, start=order.start, lanes=1, catalogue=None)
    with pytest.raises(ValueError, match="expected a bundle to start from"):
        command._order(args)


def test_test_scans_are_of_nominal_hulls_where_training_never_looks(monkeypatch):
    monkeypatch.setattr(scans, "HEADINGS_DEG", (0, 90))
    monkeypatch.setattr(scans, "UNKNOWN_HULLS", 3)
    found = scans.calm(Catalogue(DEFAULT.entries[:2]))
    known = found.label < 2
    assert known.sum() == 2 * 2 * len(recipes.GRID_DISTANCES)
    assert set(found.hull_seed[known]) == {-1}
    assert set(found.hull_seed[~known]) <= set(recipes.TEST_HULLS)
    assert (found.range_m % 10 < 1e-9).all()
    assert np.degrees(found.heading) == pytest.approx(np.round(np.degrees(found.heading)))


def test_evaluation_counts_what_was_said(tmp_path, monkeypatch):
    write_untrained(tmp_path / "bundle")
    (tmp_path / "default.toml").write_text(
        "".join(f'[[vessel]]\nname = "{name}"\ntype = "{name}"\n' for name in DEFAULT.names)
    )
    monkeypatch.setattr(scans, "HEADINGS_DEG", (40,))
    monkeypatch.setattr(scans, "UNKNOWN_HULLS", 2)
    monkeypatch.setattr(scans, "HARD", 20)
    out = tmp_path / "work/evaluation.json"
    order = ["--catalogue", str(tmp_path / "default.toml"), "--bundle", str(tmp_path / "bundle")]
    evaluate.main([*order, "--out", str(out)])
    found = json.loads(out.read_text())
    calm, counts = found["calm"]["numbers"], np.array(found["calm"]["confusion"])
    # The untrained bundle calls everything by the first name, or unknown where it is too long for all of them.
    assert calm["accuracy"] == pytest.approx(1 / 5, abs=0.05)
    assert counts[:5].sum() == calm["clusters"] == 45
    assert counts[:, 1:5].sum() == 0
    assert found["hard"]["numbers"]["clusters"] > 0
    done = Order(tmp_path / "default.toml", tmp_path / "bundle", tmp_path / "work", QUICK, 1, tmp_path)
    spent = {"minutes": 12.0, "processor": 20.0, "code": "abc"}
    report = write_report(done, read_catalogue(done.catalogue), [], spent)
    text = report.read_text()
    assert f"| right vessel, when one of the catalogue must be named | {100 * calm['accuracy']:.1f} %" in text
    assert "plan `quick`" in text
    assert (tmp_path / "work/results.png").stat().st_size > 10_000

    (tmp_path / "work/spent.json").write_text(json.dumps(spent))
    (tmp_path / "work").rename(tmp_path / "quick")
    numbers = real_catalogue.numbers_of(tmp_path)
    assert numbers["R.accuracy.best"] == numbers["R.accuracy.best.quick"] == calm["accuracy"]
    assert numbers["R_hard.heading.best.within_5deg"] == found["hard"]["numbers"]["heading.within_5deg"]
    section = page.section(numbers, {"plans": ["quick"], "meshes": real_catalogue.FLEET})
    assert "**NOT reached**" in section
    assert "took 12 minutes on two lanes (20 minutes of processor). The full plan has not been run." in section
