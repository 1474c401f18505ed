"""The model bundle: a folder with manifest.toml and ONNX files, verified before anything is trusted.

format = 1
name = "default"
[training]                      # free: commit, seed, ...
[[catalogue]]                   # in the order of the networks' classes; metres above the waterline
name = "rhib"; length = 9.0; beam = 2.8; height = 3.5
[models.prior]
file = "prior.onnx"; sha256 = "..."
inputs = [{name = "images", shape = [-1, 5, 16, 32], dtype = "float32"}]
outputs = [{name = "logits", shape = [-1, 6], dtype = "float32"}]
[parameters.best]               # free tables that the stages read: temperatures, thresholds, pixel sizes
[scores]                        # free: what the bundle reached when it was made
"""

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from shipshape.errors import BundleError
from shipshape.onnx_model import OnnxModel, Signature, TensorSpec
from shipshape.providers import PROCESSOR, Runtime
from shipshape.types import ImageMethod, ReferenceBox

MANIFEST = "manifest.toml"
FORMAT = 1
UNKNOWN = "unknown"  # how a recognition calls what is not in the catalogue, so no vessel may be called so


@dataclass(frozen=True, slots=True)
class CatalogueVessel:
    """One vessel that the bundle was trained to know."""

    name: str
    box: ReferenceBox


@dataclass(frozen=True, slots=True)
class Bundle:
    """Everything the stages need that was learnt or measured; immutable, shared by all workers."""

    name: str
    digest: str  # sha256 of manifest.toml, which holds the sha256 of every other file
    catalogue: tuple[CatalogueVessel, ...]
    models: Mapping[str, OnnxModel]
    parameters: Mapping[str, Any]
    scores: Mapping[str, Any]
    training: Mapping[str, Any]


def load_bundle(path: Path, runtime: Runtime = PROCESSOR) -> Bundle:
    """The bundle in the folder `path`, every file compared with its sha256 before it is parsed.

    Args:
        path: The folder.
        runtime: Where its networks run.

    Raises:
        BundleError: One sentence that says what was expected and what came.
    """
    content = _read_manifest(path)
    spec = _parse_manifest(content)
    return _bundle(content, spec, {name: _load_model(path, model, runtime) for name, model in spec.models.items()})


def read_bundle(path: Path) -> Bundle:
    """The same without its networks, which are not looked at; raises BundleError for the manifest alone."""
    content = _read_manifest(path)
    return _bundle(content, _parse_manifest(content), {})


def _bundle(content: bytes, spec: "_ManifestSpec", models: Mapping[str, OnnxModel]) -> Bundle:
    return Bundle(
        name=spec.name,
        digest=hashlib.sha256(content).hexdigest(),
        catalogue=tuple(vessel.to_vessel() for vessel in spec.catalogue),
        models=_Table("models", models),
        parameters=_Table("parameters", spec.parameters),
        scores=spec.scores,
        training=spec.training,
    )


def check_fit(bundle: Bundle) -> None:
    """Refuse a bundle whose catalogue, networks and parameters are each sound but do not belong together.

    Raises:
        BundleError: A classifier is of another number of classes than the catalogue, or a parameter that the
            stages read is missing or of a type or range that they cannot use.
    """
    try:
        _Parameters.model_validate({name: dict(table) for name, table in bundle.parameters.items()})
    except ValidationError as error:
        raise BundleError(_first_complaint(error, "parameters")) from error
    known = len(bundle.catalogue)
    classes = dict.fromkeys(("prior", "aligned", "points", "inpainting", "spd2"), known + 1)  # and "unknown"
    classes |= {f"spd2_{method}": known for method in ImageMethod}
    for name in classes.keys() & bundle.models.keys():
        last = bundle.models[name].signature.outputs[-1].shape[-1:]
        if last not in ((), (-1,), (classes[name],)):
            raise BundleError(
                f"expected {name} to tell {classes[name]} classes, for the {known} vessels of the catalogue, "
                f"got a network for {last[0]}"
            )


class _Table(dict[str, Any]):
    """A table of the manifest; a stage that misses a key in it learns that the bundle is to blame."""

    def __init__(self, path: str, content: Mapping[str, Any]) -> None:
        super().__init__((key, _as_table(f"{path}.{key}", value)) for key, value in content.items())
        self._path = path

    def __missing__(self, key: str) -> Any:
        raise BundleError(f"expected {self._path}.{key} in {MANIFEST}, got {', '.join(self) or 'nothing'}")


def _as_table(path: str, value: Any) -> Any:
    return _Table(path, value) if isinstance(value, dict) else value


class _Spec(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class _TensorEntry(_Spec):
    name: str
    shape: list[Annotated[int, Field(ge=-1)]]
    dtype: str

    def to_spec(self) -> TensorSpec:
        """The tensor as the rest of the service knows it."""
        return TensorSpec(self.name, tuple(self.shape), self.dtype)


class _ModelEntry(_Spec):
    file: Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9._-]*$")]  # a plain name cannot leave the folder
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    inputs: list[_TensorEntry]
    outputs: list[_TensorEntry]

    def to_signature(self) -> Signature:
        """What goes into the network and comes out, in the order of the file."""
        return Signature(
            inputs=tuple(entry.to_spec() for entry in self.inputs),
            outputs=tuple(entry.to_spec() for entry in self.outputs),
        )


# What the stages read of [parameters.*]; whatever else stands there is free.
_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Share = Annotated[float, Field(ge=0, le=1)]


class _StageTable(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)


class _Common(_StageTable):
    spd2_radius: _Positive
    prior_temperature: _Positive
    unknown_above: _Share


class _Paper(_StageTable):
    heading_std: _Positive
    part_keypoints: Annotated[int, Field(ge=1, le=1000)]
    part_sharpness: _Finite
    empty_below: Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _Best(_StageTable):
    looks: Annotated[int, Field(ge=1, le=10)]
    heading_std_scale: _Positive
    heading_std_power: _Positive = 1.0
    bow_weights: Annotated[list[_Finite], Field(min_length=2, max_length=2)]  # aligned looks, first look
    # prior, aligned looks, bottleneck, restored cloud
    fusion_weights: Annotated[list[_Finite], Field(min_length=4, max_length=4)]


class _Reasons(_StageTable):
    few_points: Annotated[int, Field(ge=0)] = 0
    end_on_deg: Annotated[float, Field(ge=0, le=90)] = 0.0
    occluded_above: _Share = 1.0
    bow_below: _Share = 0.0


class _Parameters(_StageTable):
    common: _Common
    paper: _Paper
    best: _Best
    reasons: _Reasons = _Reasons()  # bundles of before there were reasons have none


_Metres = Annotated[float, Field(gt=0, le=1000)]


class _VesselEntry(_Spec):
    name: Annotated[str, Field(min_length=1)]
    length: _Metres
    beam: _Metres
    height: _Metres

    def to_vessel(self) -> CatalogueVessel:
        """The entry as the rest of the service knows it; metres."""
        return CatalogueVessel(self.name, ReferenceBox(self.length, self.beam, self.height))


class _ManifestSpec(_Spec):
    format: Literal[1]
    name: Annotated[str, Field(min_length=1)]
    catalogue: Annotated[list[_VesselEntry], Field(min_length=1)]
    models: dict[str, _ModelEntry]
    training: dict[str, Any] = {}
    parameters: dict[str, Any] = {}
    scores: dict[str, Any] = {}


def _read_manifest(folder: Path) -> bytes:
    if not folder.is_dir():
        raise BundleError(
            f"expected a bundle folder at {folder}, got {'a file' if folder.exists() else 'nothing'}: "
            "--bundle or SHIPSHAPE_BUNDLE names another"
        )
    try:
        return (folder / MANIFEST).read_bytes()
    except OSError as error:
        raise BundleError(f"expected to read {MANIFEST} in {folder}, got: {error.strerror}") from error


def _parse_manifest(content: bytes) -> _ManifestSpec:
    try:
        table = tomllib.loads(content.decode())
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BundleError(f"expected {MANIFEST} to be TOML, got: {error}") from error
    # Before everything else: a later format may differ in anything but this line.
    if table.get("format") != FORMAT:
        raise BundleError(f"expected {MANIFEST} of format {FORMAT}, got format {table.get('format', '(none)')}")
    try:
        spec = _ManifestSpec.model_validate(table)
    except ValidationError as error:
        raise BundleError(_first_complaint(error)) from error
    _check_names([vessel.name for vessel in spec.catalogue])
    return spec


def _first_complaint(error: ValidationError, *above: str) -> str:
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, (*above, *first["loc"])))
    if first["type"] == "missing":
        return f"expected the key {where} in {MANIFEST}, got none"
    return f"expected another value of {where} in {MANIFEST}, got {first['input']!r:.80}: {first['msg']}"


def _check_names(names: list[str]) -> None:
    if len(set(names)) != len(names) or UNKNOWN in names:
        raise BundleError(
            f"expected distinct catalogue names other than {UNKNOWN!r} in {MANIFEST}, got {', '.join(names)}"
        )


def _load_model(folder: Path, entry: _ModelEntry, runtime: Runtime) -> OnnxModel:
    try:
        content = (folder / entry.file).read_bytes()
    except OSError as error:
        raise BundleError(f"expected to read {entry.file} in {folder}, got: {error.strerror}") from error
    digest = hashlib.sha256(content).hexdigest()
    if digest != entry.sha256:
        raise BundleError(f"expected sha256 {entry.sha256} of {entry.file}, got {digest}")
    return OnnxModel(content, entry.to_signature(), label=entry.file, runtime=runtime)
