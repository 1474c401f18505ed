"""Writes the manifest of a bundle from its ONNX files: the counterpart of `load_bundle`, for training."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from shipshape.bundle import FORMAT, MANIFEST, Bundle, CatalogueVessel, load_bundle
from shipshape.errors import BundleError
from shipshape.onnx_model import OnnxModel, TensorSpec


def write_manifest(
    folder: Path,
    *,
    name: str,
    training: Mapping[str, Any],
    catalogue: Sequence[CatalogueVessel],
    models: Mapping[str, Path],
    **tables: Mapping[str, Any],
) -> Bundle:
    """The bundle in `folder`, after writing its manifest and reading it back.

    Args:
        folder: The bundle folder, which holds the ONNX files already.
        name: The bundle's name, as the service reports it.
        training: Commit, seed and whatever else says how to make the bundle again.
        catalogue: The vessels, in the order of the networks' classes.
        models: ONNX file of each model, inside `folder` (a bare name will do).
        **tables: `parameters` and `scores`, free tables; NumPy numbers and arrays are allowed.

    Raises:
        BundleError: A model is not an ONNX file directly inside `folder`, or the result does not load.
    """
    manifest = {
        "format": FORMAT,
        "name": name,
        "training": training,
        "catalogue": [_vessel_table(vessel) for vessel in catalogue],
        "models": {model: _model_table(folder, Path(file)) for model, file in models.items()},
        **tables,
    }
    text = tomli_w.dumps(_plain(manifest))
    # Written aside and then moved, so that a crash never leaves half a manifest.
    draft = folder / f".{MANIFEST}.draft"
    draft.write_text(text, encoding="utf-8")
    draft.replace(folder / MANIFEST)
    return load_bundle(folder)


def _vessel_table(vessel: CatalogueVessel) -> dict[str, Any]:
    box = vessel.box
    return {"name": vessel.name, "length": box.length, "beam": box.beam, "height": box.height}


def _model_table(folder: Path, file: Path) -> dict[str, Any]:
    path = folder / file.name
    if file not in (path, Path(file.name)):
        raise BundleError(f"expected every model file directly inside {folder}, got {file}")
    signature = OnnxModel(path).signature
    return {
        "file": path.name,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "inputs": [_tensor_table(spec) for spec in signature.inputs],
        "outputs": [_tensor_table(spec) for spec in signature.outputs],
    }


def _tensor_table(spec: TensorSpec) -> dict[str, Any]:
    return {"name": spec.name, "shape": list(spec.shape), "dtype": spec.dtype}


def _plain(value: Any) -> Any:
    """`value` with NumPy numbers and arrays turned into those that TOML knows."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
