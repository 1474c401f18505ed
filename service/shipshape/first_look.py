"""The first look at a cluster: a network sees its points along the line of sight, before anything else is known.

It groups points around centres, describes each group, and groups the groups once more (PointNet++, Qi et al.,
NeurIPS 2017; offsets in a group are shares of its radius and every point knows its own place too, as in
PointNeXt, Qian et al., NeurIPS 2022). What it says needs no pose, so nothing that hides a part of the vessel can
mislead it twice.
"""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from shipshape import frames, kernels
from shipshape.onnx_model import OnnxModel
from shipshape.sight import SightFrame
from shipshape.types import Pose, ReferenceBox

MOST_POINTS = 512  # more add nothing that the network can use, and time
CENTRES = (128, 32)  # groups of points, and groups of groups
NEIGHBOURS = 16  # members of a group
RADII = (2.0, 6.0)  # m
UNIT = 10.0  # m; coordinates in it are of the order of one


@dataclass(frozen=True, slots=True)
class FirstLook:
    """What the network said of the cluster as the sensor sees it."""

    pose: Pose  # coarse; its bow may point either way
    bow_level: tuple[float, float]  # level frame; half the log-odds that the bow points along +x, and along +y
    class_logits: Float32[np.ndarray, " classes"]

    def flip_logit(self, pose: Pose) -> float:
        """Log-odds that the bow points the opposite way of `pose`."""
        ahead = (math.cos(pose.heading), math.sin(pose.heading))
        return -2.0 * (self.bow_level[0] * ahead[0] + self.bow_level[1] * ahead[1])


def network_inputs(points_sight: Float32[np.ndarray, "n 3"], sight: SightFrame) -> dict[str, np.ndarray]:
    """The network's inputs for a cluster in the sight frame; c <= 128 groups, d <= 32 groups of groups.

    Returns:
        near: (6, c, 16), members of each group: offset from its centre, share of 2 m, and place, units of 10 m.
        members: (16 d,), which groups each group of groups has.
        far: (3, d, 16), where those lie: offset from the centre, share of 6 m.
        centres: (3, d, 1), units of 10 m.
        features: (3,), log range, log number of points, whether the height above the water is known.
    """
    points = _lowest_first(points_sight)
    first = points[kernels.farthest_points(points, CENTRES[0])]
    second = first[kernels.farthest_points(first, CENTRES[1])]
    near = kernels.in_ball(points, first, RADII[0], NEIGHBOURS)
    members = kernels.in_ball(first, second, RADII[1], NEIGHBOURS)
    features = [math.log(max(sight.range_m, 1.0)), math.log(len(points_sight)), sight.knows_water]
    return {
        "near": kernels.describe_groups(points, first, near, (RADII[0], UNIT)),
        "members": members.reshape(-1),
        "far": kernels.describe_groups(first, second, members, (RADII[1], UNIT))[:3],
        "centres": np.ascontiguousarray(second.T)[:, :, None] / np.float32(UNIT),
        "features": np.array(features, np.float32),
    }


def _lowest_first(points: Float32[np.ndarray, "n 3"]) -> Float32[np.ndarray, "k 3"]:
    """At most MOST_POINTS of the points, even over heights; the order in which they came does not matter."""
    order = np.argsort(points[:, 2], kind="stable")
    shown = min(len(order), MOST_POINTS)
    return np.ascontiguousarray(points[order[np.arange(shown) * len(order) // shown]])


def filled_up(inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The inputs of any cluster in the shape of a large one: the last group comes again, up to CENTRES.

    The network takes the greatest of each feature over all groups: one that comes twice changes nothing.
    """
    near, whole = (
        np.minimum(np.arange(most), inputs[name].shape[1] - 1)
        for most, name in zip(CENTRES, ("near", "far"), strict=True)
    )
    return {
        "near": inputs["near"][:, near],
        "members": inputs["members"].reshape(-1, NEIGHBOURS)[whole].reshape(-1),
        "far": inputs["far"][:, whole],
        "centres": inputs["centres"][:, whole],
        "features": inputs["features"],
    }


def first_look(points_sight: Float32[np.ndarray, "n 3"], sight: SightFrame, model: OnnxModel) -> FirstLook:
    """Show the network the cluster."""
    inputs = network_inputs(points_sight, sight)
    if model.most_rows > 1:  # with calls of the same shape alone, and most clusters have fewer points than CENTRES
        inputs = filled_up(inputs)
    axis, shift, size, bow, classes = model.run(**{name: value[None] for name, value in inputs.items()})
    outward = cmath.rect(1.0, sight.bearing)
    step = complex(*shift[0].tolist()) * UNIT * outward
    ahead = complex(*bow[0].tolist()) * outward
    x, y, z = sight.origin_level
    pose = Pose(
        frames.wrap_angle(sight.bearing + 0.5 * math.atan2(*axis[0].tolist())),
        (x + step.real, y + step.imag, z),
        ReferenceBox(*map(math.exp, size[0].tolist())),
    )
    return FirstLook(pose, (ahead.real, ahead.imag), classes[0])
