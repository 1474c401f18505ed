"""The command line's arguments -> what to compute, of what, and where."""

import argparse
import math
from dataclasses import fields
from pathlib import Path

from shipshape.batch.engines import Engine, LocalEngine, ServiceEngine
from shipshape.batch.method import Method, Segmentation
from shipshape.batch.service import Service
from shipshape.client import Endpoint
from shipshape.errors import SettingsError
from shipshape.executor import usable_cores
from shipshape.pointfiles.clusters import ID_NAMES
from shipshape.settings import load_settings
from shipshape.types import ImageMethod, Preset


def method_of(arguments: argparse.Namespace) -> Method:
    """What the arguments say of how rows are computed.

    Raises:
        SettingsError: A value that cannot work, or two that do not go together.
    """
    if arguments.image_method is not None and arguments.preset is not Preset.PAPER:
        raise SettingsError(f"expected --image-method with --preset paper alone, got --preset {arguments.preset}")
    height = arguments.sensor_height
    if height is not None and not 0 < height < 200:
        raise SettingsError(f"expected --sensor-height between 0 and 200 m, got {height}")
    return Method(
        preset=arguments.preset,
        image_method=arguments.image_method or ImageMethod.FULL_SIDE,
        sensor_height=height,
        own_true_heading_deg=arguments.own_heading,
        topics=tuple(arguments.topic or ()),
        id_names=(arguments.id_field,) if arguments.id_field else ID_NAMES,
        segmentation=_segmentation(arguments),
        restored=arguments.restored,
    )


def engine_of(arguments: argparse.Namespace, method: Method) -> Engine:
    """The engine that the arguments ask for, started.

    Raises:
        SettingsError: Two are asked for, a number of workers that cannot be, or nobody answers there.
        BundleError: The bundle cannot be used.
    """
    if arguments.service and arguments.ray:
        raise SettingsError("expected --service or --ray, got both")
    if arguments.service:
        own = {"ca": arguments.ca, "certificate": arguments.cert, "key": arguments.key}
        return ServiceEngine(Service(Endpoint(arguments.service, **own, token_file=arguments.token_file)))
    folder = arguments.bundle or load_settings().bundle
    if arguments.ray:
        return _ray_engine(arguments.ray, folder)
    workers = usable_cores() if arguments.workers is None else arguments.workers
    if not 1 <= workers <= 1024:
        raise SettingsError(f"expected --workers of 1 to 1024, got {workers}")
    return LocalEngine.start(folder, method, workers)


def _ray_engine(address: str, folder: Path) -> Engine:
    try:
        from shipshape.batch.ray_data import RayEngine  # noqa: PLC0415  its libraries are an extra of their own
    except ModuleNotFoundError as error:
        raise SettingsError(
            f"expected the libraries of the extra shipshape[ray] to be installed, got no {error.name}"
        ) from error
    return RayEngine.start(address, folder)


def _segmentation(arguments: argparse.Namespace) -> Segmentation | None:
    given = {field.name: getattr(arguments, field.name) for field in fields(Segmentation)}
    given = {name: value for name, value in given.items() if value is not None}
    if not arguments.segment:
        if given:
            raise SettingsError(f"expected --segment beside --{min(given).replace('_', '-')}, got it alone")
        return None
    for name, value in given.items():
        least = 0.01 if name == "gap" else 1 if name == "min_points" else 0.0
        if not (math.isfinite(value) and value >= least):
            raise SettingsError(f"expected --{name.replace('_', '-')} of {least:g} or more, got {value}")
    return Segmentation(**given)
