"""A bundle of untrained networks, small enough to build in a moment, with which the whole pipeline runs.

Each network is a fixed random linear map of what it is shown, squashed to where a trained one would answer: its
output means nothing, but it depends on every input, so that a frame, a sign or a plane mixed up shows.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from shipshape.bundle import Bundle, CatalogueVessel
from shipshape.onnx_model import OnnxModel
from shipshape.types import ImageMethod, ReferenceBox

CATALOGUE = (
    CatalogueVessel("rhib", ReferenceBox(length=9.0, beam=2.8, height=3.5)),
    CatalogueVessel("pilot_boat", ReferenceBox(length=12.0, beam=4.0, height=3.0)),
    CatalogueVessel("tug", ReferenceBox(length=24.0, beam=10.4, height=11.8)),
)
CLASSES = len(CATALOGUE) + 1  # and "unknown"
PARAMETERS: Mapping[str, Any] = {
    "common": {"spd2_radius": 3.0, "prior_temperature": 1.0, "unknown_above": 0.3},
    "paper": {
        "heading_std": 0.05,
        "part_keypoints": 8,
        "part_sharpness": 2.0,
        "empty_below": 0.5,
    },
    "best": {
        "looks": 2,
        "heading_std_scale": 1.0,
        "bow_weights": [0.5, 0.5],
        "fusion_weights": [0.4, 0.3, 0.2, 0.1],
    },
}


class _Graph:
    """Collects the nodes of a network; every method returns the name of what it computes."""

    def __init__(self, seed: int, *, counts: str = "", **inputs: tuple[int | str, ...]) -> None:
        self._rng = np.random.default_rng(seed)
        kinds = {name: TensorProto.INT64 if name == counts else TensorProto.FLOAT for name in inputs}
        self._inputs = [
            helper.make_tensor_value_info(name, kinds[name], ["batch", *shape]) for name, shape in inputs.items()
        ]
        self._nodes: list[onnx.NodeProto] = []
        self._weights: list[onnx.TensorProto] = []

    def node(self, kind: str, *inputs: str, **attributes: Any) -> str:
        name = f"{kind}_{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def weights(self, values: np.ndarray) -> str:
        name = f"weights_{len(self._weights)}"
        self._weights.append(numpy_helper.from_array(values, name))
        return name

    def linear(self, seen: str, inputs: int, middle: tuple[float, ...], scale: float) -> str:
        """`middle` + `scale` * tanh(W seen), flat; `seen` is (batch, inputs)."""
        weights = self.weights(self._rng.normal(0, 1 / np.sqrt(inputs), (inputs, len(middle))).astype("f4"))
        moved = self.node("Tanh", self.node("MatMul", seen, weights))
        scaled = self.node("Mul", moved, self.weights(np.float32(scale)))
        return self.node("Add", scaled, self.weights(np.array(middle, np.float32)))

    def pooled(self, planes: str) -> str:
        """Mean of each plane, (batch, planes)."""
        return self.node("Flatten", self.node("GlobalAveragePool", planes))

    def mixed(self, planes: str, inputs: int, outputs: int) -> str:
        """Sigmoid of a random mix of the planes in each pixel."""
        weights = self._rng.normal(0, 1, (outputs, inputs, 1, 1)).astype(np.float32)
        return self.node("Sigmoid", self.node("Conv", planes, self.weights(weights)))

    def model(self, **outputs: str) -> OnnxModel:
        nodes = [*self._nodes, *(helper.make_node("Identity", [made], [name]) for name, made in outputs.items())]
        infos = [helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in outputs]
        graph = helper.make_graph(nodes, "untrained", self._inputs, infos, self._weights)
        opset = [helper.make_opsetid("", 17)]
        return OnnxModel(helper.make_model(graph, opset_imports=opset, ir_version=9).SerializeToString())


def spd2_network(classes: int, seed: int, favourite: int | None = None) -> OnnxModel:
    """SPD2 image -> logits; `favourite` is the class that always wins."""
    graph = _Graph(seed, images=(5, 16, 32))
    middle = tuple(8.0 if index == favourite else 0.0 for index in range(classes))
    return graph.model(logits=graph.linear(graph.node("Flatten", "images"), 5 * 16 * 32, middle, 1.0))


def points_network() -> OnnxModel:
    """Groups of points -> axis near 45 degrees to the line of sight, small shift, about 12 x 4 x 3 m, logits."""
    groups = {"near": (6, "groups", 16), "members": ("members",), "far": (3, "wholes", 16)}
    graph = _Graph(11, counts="members", **groups, centres=(3, "wholes", 1), features=(3,))
    told = graph.node("Mul", graph.node("Cast", "members", to=TensorProto.FLOAT), graph.weights(np.float32(0.01)))
    pooled = [*map(graph.pooled, ("near", "far", "centres")), graph.node("ReduceMean", told, axes=[1])]
    seen = graph.node("Concat", *pooled, "features", axis=1)
    return graph.model(
        axis=graph.linear(seen, 16, (1.0, 0.0), 0.2),
        shift=graph.linear(seen, 16, (0.04, 0.0), 0.04),
        size=graph.linear(seen, 16, tuple(np.log([12.0, 4.0, 3.0])), 0.1),
        bow=graph.linear(seen, 16, (-1.0, 0.0), 0.5),
        classes=graph.linear(seen, 16, (0.0, 2.0, 0.0, 0.0), 0.5),
    )


def aligned_network() -> OnnxModel:
    """Aligned planes -> small corrections, a bow that points the opposite way, logits."""
    graph = _Graph(12, planes=(9, 32, 64), features=(3,))
    seen = graph.node("Concat", graph.pooled("planes"), "features", axis=1)
    return graph.model(
        turn=graph.linear(seen, 12, (0.05, -3.0), 0.05),
        flip=graph.linear(seen, 12, (2.0,), 0.5),
        shift=graph.linear(seen, 12, (0.02, 0.0, 0.0), 0.02),
        size=graph.linear(seen, 12, tuple(np.log([1.0, 1 / 3, 1 / 4])), 0.05),
        classes=graph.linear(seen, 12, (0.0, 3.0, 0.0, 0.0), 0.5),
    )


def inpainting_network() -> OnnxModel:
    """Aligned planes and their mirror -> occupancy, top, bottom, offset, class logits."""
    graph = _Graph(13, planes=(18, 32, 64), features=(3,))
    seen = graph.node("Concat", graph.pooled("planes"), "features", axis=1)
    flat = graph.node("Sub", graph.mixed("planes", 18, 6), graph.weights(np.float32(0.5)))
    shape = graph.weights(np.array([-1, 2, 3, 32, 64], np.int64))
    top = graph.mixed("planes", 18, 3)
    return graph.model(
        occupancy=graph.mixed("planes", 18, 3),
        top=top,
        bottom=graph.node("Mul", top, graph.mixed("planes", 18, 3)),
        offset=graph.node("Reshape", flat, shape),
        classes=graph.linear(seen, 21, (0.0, 1.0, 0.0, 0.0), 0.5),
    )


def grey_network(seed: int) -> OnnxModel:
    """The paper's grey image -> another one."""
    graph = _Graph(seed, image=(3, 64, 64))
    return graph.model(filled=graph.mixed("image", 3, 3))


def untrained_bundle() -> Bundle:
    """Every network and parameter that both presets and all four image methods ask for."""
    models = {
        "prior": spd2_network(CLASSES, 1, favourite=1),
        "parts": spd2_network(3, 2),
        "aligned": aligned_network(),
        "points": points_network(),
        "inpainting": inpainting_network(),
        "spd2": spd2_network(CLASSES, 3),
    }
    for seed, method in enumerate(ImageMethod, start=20):
        models[f"inpainting_{method}"] = grey_network(seed)
        models[f"spd2_{method}"] = spd2_network(len(CATALOGUE), seed)
    return Bundle("untrained", "0" * 64, CATALOGUE, models, PARAMETERS, {}, {})
