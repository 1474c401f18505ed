"""Tiny ONNX files and bundles that need no training."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper

from shipshape.bundle import Bundle, CatalogueVessel
from shipshape.bundle_writer import write_manifest
from shipshape.types import ReferenceBox

CATALOGUE = (
    CatalogueVessel("rhib", ReferenceBox(length=9.0, beam=2.8, height=3.5)),
    CatalogueVessel("tug", ReferenceBox(length=24.0, beam=10.4, height=11.8)),
)


def doubling_onnx(*, input_name: str = "x", columns: int | str = 3, dtype: int = TensorProto.FLOAT) -> bytes:
    """A network that returns `doubled` = 2 `x` and the row sums `sums`."""
    shape = ["n", columns]
    two = helper.make_tensor("two", dtype, [], np.array(2, helper.tensor_dtype_to_np_dtype(dtype)))
    axes = helper.make_tensor("axes", TensorProto.INT64, [1], [1])
    graph = helper.make_graph(
        [
            helper.make_node("Mul", [input_name, "two"], ["doubled"]),
            helper.make_node("ReduceSum", [input_name, "axes"], ["sums"], keepdims=0),
        ],
        "doubling",
        [helper.make_tensor_value_info(input_name, dtype, shape)],
        [
            helper.make_tensor_value_info("doubled", dtype, shape),
            helper.make_tensor_value_info("sums", dtype, ["n"]),
        ],
        [two, axes],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    return model.SerializeToString()


def write_tiny_bundle(folder: Path) -> Bundle:
    """A valid bundle with one network, `prior`."""
    folder.mkdir(exist_ok=True)
    (folder / "prior.onnx").write_bytes(doubling_onnx())
    return write_manifest(
        folder,
        name="tiny",
        training={"commit": "0" * 40, "seed": 1},
        catalogue=CATALOGUE,
        models={"prior": Path("prior.onnx")},
        parameters={"best": {"temperature": np.float32(1.5), "edges": np.arange(3)}},
        scores={"accuracy": 0.98},
    )
