"""Classifiers of complete clouds: what they are trained on, and that the command writes a network."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

from hulls import box_hull

from shipshape.onnx_model import OnnxModel
from shipshape.types import ImageMethod, ReferenceBox
from shipshape_lab.simulator import datasets
from shipshape_lab.simulator.clusters import save
from shipshape_lab.simulator.surface import sample_surface
from shipshape_lab.training import train_complete

BOX = ReferenceBox(20.0, 6.0, 4.0)


@pytest.fixture(scope="module")
def surface():
    return sample_surface(box_hull(), 6_000, np.random.default_rng(1))


@pytest.mark.parametrize("method", list(ImageMethod))
def test_an_encoded_box_is_still_that_box(surface, method):
    cloud = train_complete.encoded(surface, method, BOX, BOX.length)
    pixel = 1.1 * BOX.length / 64
    assert np.abs(cloud[:, 0]).max() == pytest.approx(10.0, abs=pixel)
    assert cloud[:, 2].max() == pytest.approx(4.0, abs=pixel)
    outside = np.maximum(np.abs(cloud) - [10.0, 3.0, 4.0], 0.0)
    to_face = np.minimum(np.abs(np.abs(cloud) - [10.0, 3.0, 4.0]).min(axis=1), np.abs(cloud[:, 2]))
    assert outside.max() < pixel
    assert np.mean(to_face < pixel) > 0.99


def test_raw_surfaces_are_seen_at_other_headings_than_their_own(surface):
    images = train_complete.of_raw(surface, 0, np.random.default_rng(2))
    own = train_complete.describe_many(surface[: train_complete.RAW_POINTS])
    assert len(images) == 2 * train_complete.KEYPOINTS
    assert np.abs(images[:64].mean(axis=(0, 1, 2)) - own.mean(axis=(0, 1, 2))).max() > 0.02
    assert images.mean() == pytest.approx(own.mean(), rel=0.2)  # but it is the same surface


def test_only_hulls_of_the_catalogue_are_taught_and_a_network_comes_out(tmp_path, monkeypatch):
    monkeypatch.setattr(datasets, "SURFACE_POINTS", 3_000)
    hulls = [("tug", 1), ("rhib", 0), ("rhib", 1), ("small_ferry", 1), ("tug", 2), ("patrol_boat", 3)]
    save(tmp_path / "train_surfaces.npz", datasets.make_surfaces(hulls, progress=False))
    save(tmp_path / "train.npz", datasets.make(datasets.Job("train", 2, 7), progress=False))
    names = ["rhib", "pilot_boat", "fishing_boat", "tug", "patrol_boat"]
    taught = [label for _, label in train_complete.hulls(tmp_path, names)]
    assert taught == [3, 0, 0, 3, 4]
    arguments = ["--model", "z_top", "--data", str(tmp_path), "--out", str(tmp_path), "--epochs", "1"]
    train_complete.main(arguments)
    model = OnnxModel(tmp_path / "bundle/complete_z_top.onnx")
    (logits,) = model.run(images=np.zeros((2, 5, 16, 32), np.float32))
    assert logits.shape == (2, 5)
