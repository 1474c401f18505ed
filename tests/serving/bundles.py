"""Two bundles that differ in one number, which shows in every answer, and copies of them that are broken."""

import shutil
from pathlib import Path

import onnx
from onnx import numpy_helper

from serving.processes import MODELS
from shipshape.bundle import load_bundle
from shipshape.bundle_writer import write_manifest
from shipshape.serving.prepare import load_local

WIDER = 2.0  # times the heading_std of the shipped bundle


def copy_bundle(folder):
    return shutil.copytree(MODELS, folder)


def write_wider_bundle(folder, name="wider"):
    """The shipped bundle under another name, twice as unsure of its headings."""
    copy_bundle(folder)
    rewritten(folder, name=name, heading_std_scale=WIDER)
    return folder


def rewritten(folder, name, heading_std_scale=1.0):
    """Write the manifest again, for whatever the networks in `folder` are by now."""
    before = load_bundle(MODELS)
    best = before.parameters["best"]
    best = {**best, "heading_std_scale": best["heading_std_scale"] * heading_std_scale}
    return write_manifest(
        folder,
        name=name,
        training=before.training,
        catalogue=before.catalogue,
        models={model: Path(f"{model}.onnx") for model in before.models},
        parameters={**before.parameters, "best": best},
        scores=before.scores,
    )


def fill_with_nan(network):
    """Let every weight of a network be NaN, and the manifest agree."""
    model = onnx.load(network)
    for weights in model.graph.initializer:
        values = numpy_helper.to_array(weights)
        if values.dtype.kind == "f":
            weights.CopyFrom(numpy_helper.from_array(values * float("nan"), weights.name))
    onnx.save(model, network)
    rewritten(network.parent, name="nan")


def load_model(folder):
    return load_local(folder, 65_536)
