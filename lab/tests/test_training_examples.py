"""The targets that networks are trained on, put back through the service's stages, must give the truth."""

import math

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

import torch

from shipshape import alignment, first_look, raster, sight
from shipshape.onnx_model import OnnxModel
from shipshape.raster import FilledLayers
from shipshape.stages import lifting, projection
from shipshape_lab.metrics import CompleteSurface, chamfer_l1
from shipshape_lab.simulator import datasets
from shipshape_lab.simulator.datasets import Job
from shipshape_lab.training import train_aligned, train_inpainting, train_points
from shipshape_lab.training.examples import Examples, mirrored
from shipshape_lab.training.nets import PointsNet
from shipshape_lab.training.poses import disturbed


class Answers(OnnxModel):
    """A network that gives the answers it was handed, whatever it is asked."""

    def __init__(self, *outputs):
        self._outputs = [np.asarray(output, np.float32)[None] for output in outputs]

    def run(self, **inputs):
        return self._outputs


@pytest.fixture(scope="module")
def examples():
    clusters = datasets.make(Job("train", 12, 7), progress=False)
    hulls = {(clusters.name(i), int(clusters.hull_seed[i])) for i in range(len(clusters))}
    return Examples(clusters, datasets.make_surfaces(sorted(hulls), progress=False))


def same_pose(found, true, *, metres=0.02, modulo=math.tau):
    turn = math.remainder(found.heading - true.heading, modulo)
    assert abs(turn) < 1e-3
    np.testing.assert_allclose(found.origin_level, true.origin_level, atol=metres)


def test_clusters_lie_in_the_box_of_their_true_pose(examples):
    for i in examples.indices:
        example = examples.example(int(i))
        points = example.pose.to_vessel(example.contact.points_level)
        half = np.array([example.pose.size.length, example.pose.size.beam]) / 2
        assert np.mean(np.abs(points[:, :2]) < half + 0.5) > 0.95


def test_the_mirror_of_the_mirror_is_the_scene(examples):
    example = examples.example(0)
    twice = mirrored(mirrored(example))
    np.testing.assert_array_equal(twice.contact.points_level, example.contact.points_level)
    assert twice.pose == example.pose


def test_a_mirrored_cluster_lies_on_its_mirrored_surface(examples):
    example = mirrored(examples.example(1))
    truth = CompleteSurface(example.surface_level, 1.0)
    assert np.median(truth.nearest(example.contact.points_level).to_surface) < 0.15


def test_the_targets_of_the_first_look_lead_to_the_true_pose(examples):
    for i in examples.indices[:6]:
        example = examples.example(int(i))
        item = train_points.to_item(example)
        frame = sight.sight_frame(example.contact)
        points = sight.to_sight(example.contact.points_level, frame)
        cosine, sine = item["heading"]
        axis = (2 * sine * cosine, cosine**2 - sine**2)
        network = Answers(axis, item["step"], item["size"], item["heading"], np.zeros(6))
        found = first_look.first_look(points, frame, network)
        same_pose(found.pose, example.pose, modulo=math.pi)
        assert found.pose.size.length == pytest.approx(example.pose.size.length, rel=1e-3)
        assert found.flip_logit(example.pose) == pytest.approx(-2.0, abs=1e-3)


def test_repeated_groups_change_nothing_that_the_network_says(examples):
    example = next(e for e in map(examples.example, examples.indices) if len(e.contact.points_level) < 60)
    frame = sight.sight_frame(example.contact)
    alone = first_look.network_inputs(sight.to_sight(example.contact.points_level, frame), frame)
    torch.manual_seed(0)
    net = PointsNet(6).eval()
    few, filled = (
        net(*(torch.from_numpy(shown[name].copy())[None] for name in train_points.INPUTS))
        for shown in (alone, train_points.filled(alone))
    )
    for want, got in zip(few, filled, strict=True):
        torch.testing.assert_close(got, want)


def test_the_aligned_targets_lead_from_a_disturbed_pose_to_the_true_one(examples):
    rng = np.random.default_rng(3)
    for i in examples.indices[:6]:
        example = examples.example(int(i))
        guess = disturbed(example.pose, rng, wide=True)
        guess = guess.turned(math.pi) if i % 2 else guess
        item = train_aligned.to_item(example, guess)
        outputs = ([item["turn"], 0.0], [item["flip"]], item["shift"], item["size"], np.zeros(6))
        found = alignment.look(example.contact.points_level, guess, Answers(*outputs))
        same_pose(found.pose, example.pose, modulo=math.pi)
        assert item["flip"] == float(math.cos(guess.heading - example.pose.heading) < 0)
        assert found.pose.size.beam == pytest.approx(example.pose.size.beam, rel=1e-3)


def test_the_inpainting_targets_lift_to_the_complete_surface(examples):
    for i in examples.indices[:4]:
        example = examples.example(int(i))
        item = train_inpainting.to_item(example, example.pose)
        frame = raster.aligned_frame(example.pose.size.length)
        filled = FilledLayers(item["occupied"] > 0, item["top"], item["bottom"], item["offset"])
        points = example.contact.points_level
        layers = projection.project(points, example.pose, frame)
        restored = lifting.lift_layers(points, layers, filled, example.pose, frame)
        in_frame = example.surface_level  # masts above the frame count too: they are part of the truth
        extent = float(np.ptp(in_frame, axis=0).max())
        truth = CompleteSurface(in_frame[::4], extent)
        assert chamfer_l1(truth.nearest(restored.points_level)) < 0.012
