import numpy as np
import pytest

from shipshape_lab.simulator import datasets, recipes
from shipshape_lab.simulator.catalogue import DEFAULT
from shipshape_lab.simulator.clusters import load, load_surfaces, save
from shipshape_lab.simulator.datasets import Job, grid_hull, main, make
from shipshape_lab.simulator.outsiders import OUTSIDER_TYPES
from shipshape_lab.simulator.recipes import GRID_DISTANCES, GRID_HEADINGS_DEG, RECIPES
from shipshape_lab.simulator.strangers import STRANGER_TYPES
from shipshape_lab.simulator.vessels import VESSEL_TYPES


@pytest.fixture(scope="module")
def train():
    return make(Job("train", 60, 1), progress=False)


@pytest.fixture
def few_points(monkeypatch):
    monkeypatch.setattr(datasets, "SURFACE_POINTS", 200)


def same(a, b):
    return np.array_equal(a.points, b.points) and np.array_equal(a.heading, b.heading)


def test_hull_seeds_of_the_splits_are_disjoint():
    splits = [set(s) for s in (recipes.TRAIN_HULLS, recipes.VALIDATION_HULLS, recipes.TEST_HULLS)]
    assert len(set.union(*splits)) == sum(map(len, splits))
    assert set(RECIPES["train"].hulls) == splits[0]
    assert set(RECIPES["validation"].hulls) == splits[1]
    for name in ("H", "far", "U"):
        assert set(RECIPES[name].hulls) == splits[2]
    assert {grid_hull(*cell) for cell in recipes.grid_cells(DEFAULT.names)} == splits[2]


def test_seeds_of_the_sets_differ():
    assert len(set(datasets.SEEDS.values())) == len(datasets.SEEDS) == 6


def test_no_two_clusters_of_any_sets_share_their_chance():
    # Occluders, sea, dropout and noise are all drawn from this one stream.
    first = [Job(name, 0, seed).rng(i).random(4) for name, seed in datasets.SEEDS.items() for i in range(500)]
    assert len(np.unique(np.round(first, 9).ravel())) == 4 * len(first)


def test_no_box_of_the_hard_test_stands_where_one_of_training_did():
    boxes = {name: occluders_of(name, 60) for name in ("train", "validation", "H")}
    assert all(len(found) > 5 for found in boxes.values())
    assert not boxes["H"] & (boxes["train"] | boxes["validation"])


def occluders_of(name, count):
    drawn = []
    for i in range(count):
        rng = Job(name, 0, datasets.SEEDS[name]).rng(i)
        recipe = RECIPES[name]
        placement = recipes.draw_placement(recipes.draw_band(recipe, rng), rng)
        drawn += recipes.draw_conditions(recipe, placement, 15.0, rng).occluders
    return {(box.low, box.high) for box in drawn}


def test_only_set_u_shows_outsiders_and_nothing_else():
    catalogue = datasets.with_outsiders(DEFAULT, None)
    shown = {name: {drawn_class(name, catalogue, i) for i in range(400)} for name in RECIPES}
    assert shown.pop("U") == set(OUTSIDER_TYPES)
    assert not set.union(*shown.values()) & set(OUTSIDER_TYPES)
    assert shown["far"] == set(DEFAULT.names)
    assert shown["H"] == set(VESSEL_TYPES)


def drawn_class(name, catalogue, i):
    job = Job(name, 0, datasets.SEEDS[name], catalogue)
    return datasets._draw_class(RECIPES[name], catalogue, job.rng(i))


def test_far_and_u_are_calm_scans_of_the_default_sensor_in_their_ranges():
    catalogue = datasets.with_outsiders(DEFAULT, None)
    for name, nearest, farthest in (("far", 110, 180), ("U", 30, 110)):
        made = make(Job(name, 12, datasets.SEEDS[name], catalogue), progress=False)
        assert made.range_m.min() > nearest
        assert made.range_m.max() < farthest
        assert set(made.lidar) == {"pandar64"}
        assert set(made.sensor_height) == {3.0}
        assert made.hidden_share.max() == 0.0
        assert np.array_equal(made.T_level_vessel[:, 2], np.tile([0.0, 0.0, 1.0, -3.0], (12, 1)))


def test_what_occluders_hide_is_recorded(train, tmp_path):
    assert 0.0 < np.mean(train.hidden_share > 0.0) < 0.4
    assert np.array_equal(train.occluded, train.hidden_share >= 0.1)
    save(tmp_path / "new.npz", train)
    with np.load(tmp_path / "new.npz") as arrays:
        np.savez(tmp_path / "old.npz", **{name: arrays[name] for name in arrays.files if name != "hidden_share"})
    assert np.array_equal(load(tmp_path / "new.npz").hidden_share, train.hidden_share)
    assert np.isnan(load(tmp_path / "old.npz").hidden_share).all()
    assert not load(tmp_path / "old.npz").occluded.any()


def test_a_folder_without_hulls_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["U", "--out", str(tmp_path), "--count", "2", "--meshes", str(tmp_path)])
    assert "expected .ply files" in capsys.readouterr().err


@pytest.mark.parametrize("name", RECIPES)
def test_drawn_ranges_and_headings_stay_off_the_grid(name):
    rng = np.random.default_rng(0)
    bands = [recipes.draw_band(RECIPES[name], rng) for _ in range(3000)]
    drawn = [recipes.draw_placement(band, rng) for band in bands]
    ranges = np.array([p.range_m for p in drawn])
    headings_deg = np.degrees([p.heading for p in drawn])
    assert np.abs(ranges[:, None] - np.array(GRID_DISTANCES)).min() > 0.5
    assert np.abs(headings_deg - np.round(headings_deg)).min() > 0.1
    assert headings_deg.min() > -180
    assert headings_deg.max() <= 180


def test_a_third_of_training_ranges_is_far():
    rng = np.random.default_rng(0)
    bands = [recipes.draw_band(RECIPES["train"], rng) for _ in range(4000)]
    ranges = np.array([recipes.draw_range(band, rng) for band in bands])
    assert np.mean(ranges > 125) == pytest.approx(0.35, abs=0.03)
    assert ranges.min() >= 25
    assert ranges.max() <= 200


def test_classes_are_the_catalogue_then_the_others():
    assert DEFAULT.classes[:5] == DEFAULT.names
    assert sorted(DEFAULT.classes) == sorted((*VESSEL_TYPES, *STRANGER_TYPES))


def test_clusters_are_consistent_with_their_truth(train):
    assert len(train) == 60
    assert train.n.sum() == len(train.points)
    assert train.n.min() >= 10
    assert train.points.dtype == np.float32
    assert set(train.hull_seed) <= set(recipes.TRAIN_HULLS)
    for i in range(len(train)):
        points, pose = train.cluster(i).astype(float), train.T_level_vessel[i]
        at = train.range_m[i] * np.array([np.cos(train.bearing[i]), np.sin(train.bearing[i])])
        assert pose[:2, 3] == pytest.approx(at)
        assert np.arctan2(pose[1, 0], pose[0, 0]) == pytest.approx(train.heading[i])
        box = datasets.hull(train.name(i), int(train.hull_seed[i])).mesh.bounds
        inside = (points - pose[:3, 3]) @ pose[:3, :3]
        assert np.all(inside > box[0] - 0.3)
        assert np.all(inside < box[1] + 0.3)
        assert points[:, 2].min() >= -train.sensor_height[i]


def test_a_third_lies_outside_the_catalogue():
    rngs = [Job("train", 0, 1).rng(i) for i in range(2000)]
    drawn = [datasets._draw_class(RECIPES["train"], DEFAULT, rng) for rng in rngs]
    assert np.mean([name not in DEFAULT.names for name in drawn]) == pytest.approx(0.35, abs=0.03)
    assert set(drawn) == {*VESSEL_TYPES, *STRANGER_TYPES}


def test_a_set_does_not_depend_on_how_many_clusters_or_processes_share_it(train):
    assert same(make(Job("train", 12, 1), jobs=2, progress=False), make(Job("train", 12, 1), progress=False))
    assert np.array_equal(make(Job("train", 3, 1), progress=False).cluster(2), train.cluster(2))
    assert not np.array_equal(make(Job("train", 1, 2), progress=False).cluster(0), train.cluster(0))


def test_the_paper_grid_is_whole_and_in_order():
    cells = recipes.grid_cells(DEFAULT.names)
    assert len(cells) == len(set(cells)) == 16_200
    assert cells[0] == (DEFAULT.names[0], 30, 0)
    assert cells[361] == (DEFAULT.names[0], 40, 1)
    assert cells[-1] == (DEFAULT.names[-1], 110, 359)


def test_grid_clusters_carry_their_cell():
    grid = make(Job("P", 5, 3), progress=False)
    assert np.degrees(grid.heading) == pytest.approx(np.arange(5))
    assert set(grid.range_m) == {30.0}
    assert set(grid.bearing) == {0.0}
    assert set(grid.sensor_height) == {3.0}
    assert set(grid.lidar) == {"pandar64"}
    assert recipes.grid_placement(30, 270).heading == pytest.approx(-np.pi / 2)
    assert len(GRID_HEADINGS_DEG) == 360


@pytest.mark.usefixtures("few_points")
def test_command_writes_clusters_and_surfaces_and_skips_what_is_there(tmp_path, capsys):
    order = ["validation", "--out", str(tmp_path), "--count", "4"]
    main(order)
    assert "4 clusters" in capsys.readouterr().out
    clusters, surfaces = (
        load(tmp_path / "validation.npz"),
        load_surfaces(tmp_path / "validation_surfaces.npz"),
    )
    assert surfaces.points.shape[1:] == (200, 3)
    assert {(clusters.name(i), int(clusters.hull_seed[i])) for i in range(4)} == set(surfaces.index())
    written = (tmp_path / "validation.npz").stat().st_mtime_ns
    main(order)
    assert (tmp_path / "validation.npz").stat().st_mtime_ns == written
    main([*order, "--force"])
    assert (tmp_path / "validation.npz").stat().st_mtime_ns > written
    assert same(load(tmp_path / "validation.npz"), clusters)
    main([*order[:-1], "5"])
    assert len(load(tmp_path / "validation.npz")) == 5
    assert sorted(p.name for p in tmp_path.iterdir()) == ["validation.npz", "validation_surfaces.npz"]


def test_a_file_of_something_else_is_refused(tmp_path):
    np.savez(tmp_path / "other.npz", points=np.zeros((2, 3)))
    with pytest.raises(ValueError, match="lacks"):
        load(tmp_path / "other.npz")
