"""The generative restorer: a flow that is exact where it can be worked out, and a bundle like any other."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs torch, which only `make torch` installs")

import torch
from untrained import write_untrained

from shipshape import raster
from shipshape.bundle import load_bundle
from shipshape.onnx_model import OnnxModel
from shipshape.pipeline import Pipeline
from shipshape.sample import sample_contact
from shipshape_lab.experiments.generative_spread import SAMPLES, Drawing
from shipshape_lab.generative import bundle, flow, train
from shipshape_lab.generative.net import FEATURES, PLANES, STATE, FlowNet

EDGES = raster.aligned_frame(1.0).edges


def tiny() -> FlowNet:
    torch.manual_seed(3)
    return FlowNet(6, EDGES, width=4).eval()


def random_vessel(count=2) -> tuple[torch.Tensor, ...]:
    """Occupancy 0 or 1, top, bottom and offset within their bounds."""
    draw = torch.Generator().manual_seed(5)
    lower, upper = torch.tensor(EDGES[:-1]).view(1, 3, 1, 1), torch.tensor(EDGES[1:]).view(1, 3, 1, 1)
    share = torch.rand(2, count, 3, 32, 64, generator=draw).sort(dim=0).values
    bottom, top = lower + (upper - lower) * share
    there = (torch.rand(count, 3, 32, 64, generator=draw) < 0.4).float()
    return there, top, bottom, torch.rand(count, 2, 3, 32, 64, generator=draw) - 0.5


def test_a_state_is_bounded_and_nothing_where_it_is_empty():
    there, top, bottom, offset = random_vessel()
    state = tiny().state_of(there, top, bottom, offset)
    assert state.shape == (2, STATE, 32, 64)
    assert float(state.abs().max()) <= 1.0 + 1e-6
    lowest = state[:, [3, 6, 9, 12]]  # top, bottom and offsets of the lowest layer
    assert float(lowest[(there[:, :1] == 0).expand_as(lowest)].abs().max()) == 0.0
    assert torch.equal(state[:, :3] > 0, there > 0)


def test_the_expected_state_is_the_mean_of_the_states():
    there, top, bottom, offset = random_vessel()
    net = tiny()
    full, none = (net.state_of(torch.full_like(there, share), top, bottom, offset) for share in (1.0, 0.0))
    expected = net.state_of(torch.full_like(there, 0.3), top, bottom, offset)
    torch.testing.assert_close(expected, 0.3 * full + 0.7 * none)


@pytest.mark.parametrize("steps", flow.STEPS)
def test_a_walk_stays_on_the_straight_path_to_the_vessel_it_knows(steps):
    net, seen = tiny(), []
    vessel, noise = random_vessel(1), torch.randn(1, *flow.NOISE_SHAPE)
    known = net.state_of(*vessel)
    net.decode = lambda measured, state, time: seen.append((state, time)) or vessel
    with torch.no_grad():
        *found, _ = flow.Sampler(net, steps)(torch.rand(1, PLANES, 32, 64), torch.rand(1, FEATURES), noise)
    assert len(seen) == steps
    for state, time in seen:
        torch.testing.assert_close(state, flow.on_path(noise, known, time), atol=1e-5, rtol=0)
    for out, want in zip(found, vessel, strict=True):
        assert torch.equal(out, want)


def test_the_loss_is_least_at_the_truth():
    there, top, bottom, offset = random_vessel()
    batch = {"occupied": there, "top": top * there, "bottom": bottom * there, "offset": offset}
    batch |= {"planes": torch.rand(2, PLANES, 32, 64), "features": torch.rand(2, FEATURES)}
    batch |= {"noise": torch.randn(2, *flow.NOISE_SHAPE), "time": torch.tensor([0.0, 0.7])}
    batch["label"] = torch.tensor([1, 4])
    logits = 9.0 * torch.nn.functional.one_hot(batch["label"], 6).float()

    def loss(*outputs):
        net = tiny()
        net.forward = lambda planes, features, state, time: outputs
        return float(flow.loss_of(net, batch))

    truth = loss(there, top, bottom, offset, logits)
    wrong = [(1 - there, top, bottom, offset, logits), (there, top + 0.05, bottom, offset, logits)]
    wrong += [(there, top, bottom, offset + 0.1, logits), (there, top, bottom, offset, logits.flip(1))]
    assert all(loss(*outputs) > truth + 1e-3 for outputs in wrong)


def test_the_class_never_hears_of_the_state():
    net, inputs = tiny(), (torch.rand(1, PLANES, 32, 64), torch.rand(1, FEATURES))
    states = [torch.randn(1, *flow.NOISE_SHAPE) for _ in range(2)]
    with torch.no_grad():
        one, other = (net(*inputs, state, torch.tensor([0.5])) for state in states)
    assert torch.equal(one[-1], other[-1])
    assert not torch.equal(one[0], other[0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A bundle of constant networks, and beside it flows of a tiny network."""
    folder = tmp_path_factory.mktemp("generative")
    write_untrained(folder / "base")
    train.write(tiny(), folder)
    return folder


def test_the_service_runs_a_bundle_with_a_flow_for_restorer(folder):
    made = bundle.write(folder / "base", folder / "flow_2.onnx", folder / "made", seed=1)
    assert made.training["restorer"] == "flow_2"
    taken = [spec.name for spec in made.models["inpainting"].signature.inputs]
    assert taken == ["planes", "features"]
    contact = sample_contact()
    once, again = (Pipeline(load_bundle(folder / "made")).run(contact) for _ in range(2))
    assert once.bundle == made.digest
    np.testing.assert_array_equal(once.restored.points_level, again.restored.points_level)
    other = bundle.write(folder / "base", folder / "flow_2.onnx", folder / "other", seed=2)
    assert len(Pipeline(other).run(contact).restored.points_level) != len(once.restored.points_level)


def test_kept_noise_gives_what_the_same_noise_gives_as_an_input(folder):
    bundle.write(folder / "base", folder / "flow_4.onnx", folder / "four", seed=9)
    draw = np.random.default_rng(0)
    inputs = {
        "planes": draw.random((1, PLANES, 32, 64), np.float32),
        "features": draw.random((1, FEATURES), np.float32),
    }
    noise = np.random.default_rng(9).standard_normal((1, *flow.NOISE_SHAPE), np.float32)
    given = OnnxModel(folder / "flow_4.onnx").run(**inputs, noise=noise)
    for kept, wanted in zip(OnnxModel(folder / "four/inpainting.onnx").run(**inputs), given, strict=True):
        np.testing.assert_allclose(kept, wanted, atol=1e-4)


def test_new_noise_is_drawn_for_each_run_and_the_occupancy_is_kept(folder):
    drawing = Drawing(OnnxModel(folder / "flow_2.onnx"), seed=4)
    inputs = {"planes": np.ones((1, PLANES, 32, 64), np.float32), "features": np.ones((1, FEATURES), np.float32)}
    first, second = drawing.run(**inputs), drawing.run(**inputs)
    assert not np.array_equal(first[0], second[0])
    np.testing.assert_array_equal(drawing.occupancy, second[0][0])
    assert (drawing.samples, Drawing(OnnxModel(folder / "base/inpainting.onnx"), seed=4).samples) == (SAMPLES, 1)


def test_what_is_no_flow_and_the_base_itself_are_refused(folder):
    with pytest.raises(ValueError, match=r"expected an input noise in .*, got planes, features"):
        bundle.write(folder / "base", folder / "base/inpainting.onnx", folder / "none", seed=1)
    with pytest.raises(ValueError, match="expected another folder than that of the base bundle"):
        bundle.write(folder / "base", folder / "flow_1.onnx", folder / "base", seed=1)
