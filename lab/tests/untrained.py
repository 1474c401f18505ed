"""A complete bundle whose networks always answer the same, so that experiments can run without training."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper

from shipshape.bundle import Bundle
from shipshape.bundle_writer import write_manifest
from shipshape.types import ImageMethod
from shipshape_lab.simulator.catalogue import DEFAULT

SPD2 = {"images": (5, 16, 32)}
LOOK = {"planes": (9, 32, 64), "features": (3,)}
GROUPS = {
    "near": (6, "groups", 16),
    "members": ("members",),
    "far": (3, "wholes", 16),
    "centres": (3, "wholes", 1),
    "features": (3,),
}
PARAMETERS = {
    "common": {"prior_temperature": 1.0, "spd2_radius": 2.0, "unknown_above": 0.5},
    "paper": {
        "heading_std": 0.05,
        "part_keypoints": 12,
        "part_sharpness": 1.0,
        "spd2_radius": 2.0,
        "empty_below": 0.05,
    },
    "best": {
        "looks": 2,
        "heading_std_scale": 1.0,
        "bow_weights": [0.5, 0.5],
        "fusion_weights": [1.0, 1.0, 1.0, 1.0],
    },
}


def write_untrained(folder: Path) -> Bundle:
    """A bundle that calls everything by the first name of the catalogue, and points every bow one way."""
    folder.mkdir(parents=True, exist_ok=True)
    models = {}
    for name, (inputs, outputs) in _networks().items():
        models[name] = folder / f"{name}.onnx"
        models[name].write_bytes(_constant_onnx(inputs, outputs))
    return write_manifest(
        folder,
        name="untrained",
        training={"commit": "0" * 40, "seed": 1},
        catalogue=DEFAULT.vessels(),
        models=models,
        parameters=PARAMETERS,
        scores={},
    )


def _networks() -> dict:
    logits = np.linspace(2.0, 0.0, len(DEFAULT.names) + 1)
    parts = {"logits": np.array([1.0, 0.0, 0.0])}
    occupancy = np.zeros((3, 32, 64))
    occupancy[:2, 10:22, 6:58] = 1.0
    heights = np.broadcast_to(np.array([0.15, 0.3, 0.6])[:, None, None], occupancy.shape)
    aligned = {
        "turn": np.array([0.0, -3.0]),
        "flip": np.zeros(1),
        "shift": np.zeros(3),
        "size": np.log([1.0, 0.3, 0.3]),
        "classes": logits,
    }
    inpainting = {
        "occupancy": occupancy,
        "top": heights,
        "bottom": heights,
        "offset": np.zeros((2, 3, 32, 64)),
        "classes": logits,
    }
    first = {
        "axis": np.array([1.0, 0.0]),
        "shift": np.zeros(2),
        "size": np.log([12.0, 4.0, 4.0]),
        "bow": np.zeros(2),
        "classes": logits,
    }
    grey = {"filled": np.pad(np.full((3, 20, 40), 0.5), ((0, 0), (22, 22), (12, 12)))}
    networks = {
        "prior": (SPD2, {"logits": logits}),
        "spd2": (SPD2, {"logits": logits}),
        "parts": (SPD2, parts),
        "aligned": (LOOK, aligned),
        "points": (GROUPS, first),
        "inpainting": ({"planes": (18, 32, 64), "features": (3,)}, inpainting),
    }
    for method in ImageMethod:
        networks[f"inpainting_{method}"] = ({"image": (3, 64, 64)}, grey)
        networks[f"spd2_{method}"] = (SPD2, {"logits": logits[:-1]})
    return networks


def _constant_onnx(inputs: dict[str, tuple], outputs: dict[str, np.ndarray]) -> bytes:
    """Repeats each output once a row of the first input; every input must be used, or ONNX drops it."""
    kinds = {name: TensorProto.INT64 if name == "members" else TensorProto.FLOAT for name in inputs}
    specs = [helper.make_tensor_value_info(n, kinds[n], ["batch", *s]) for n, s in inputs.items()]
    made = [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["batch", *v.shape]) for n, v in outputs.items()]
    first = next(iter(inputs))
    nodes = [
        helper.make_node("Shape", [first], ["rows"], start=0, end=1),
        helper.make_node("ConstantOfShape", ["rows"], ["zeros"]),
    ]
    stored = []
    for name, value in outputs.items():
        shape = helper.make_tensor(f"{name}_shape", TensorProto.INT64, [value.ndim + 1], [-1] + [1] * value.ndim)
        content = helper.make_tensor(f"{name}_value", TensorProto.FLOAT, value.shape, value.ravel().tolist())
        stored += [shape, content]
        nodes += [
            helper.make_node("Reshape", ["zeros", f"{name}_shape"], [f"{name}_zeros"]),
            helper.make_node("Add", [f"{name}_zeros", f"{name}_value"], [name]),
        ]
    graph = helper.make_graph(nodes, "constant", specs, made, stored)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    return model.SerializeToString()
