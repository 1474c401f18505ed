"""What the commands do, once their arguments are parsed; each returns its exit code."""

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import cv2
import orjson

from shipshape.admin_calls import admin
from shipshape.bundle import Bundle, load_bundle
from shipshape.classify import (
    Answered,
    Outcome,
    PictureFolder,
    Refused,
    Situation,
    classify_files,
    readable,
    to_record,
)
from shipshape.errors import BundleError, FileError
from shipshape.pipeline import Pipeline
from shipshape.render import render_png
from shipshape.sample import sample_contact
from shipshape.serving.tokens import check_name, fresh_token, hash_of
from shipshape.settings import SettingsError, load_settings
from shipshape.tables import answer_line, columns, refusal_line, title_line
from shipshape.types import ImageMethod, Options, Preset

OK, REFUSED = 0, 1
CHECK_RUNS = 20
PROGRESS_STEP_S = 0.1


def classify(arguments: argparse.Namespace) -> int:
    """Recognise the clusters in files; 1 when any was refused."""
    options = _options(arguments)
    bundle, pipeline = _open(arguments.bundle)
    _warm_up(pipeline, options)
    situation = Situation(arguments.sensor_height, arguments.own_heading)
    outcomes = classify_files(arguments.files, lambda contact: pipeline.run(contact, options), situation)
    if arguments.png is not None:
        outcomes = _drawn(outcomes, arguments.png)
    if sys.stderr.isatty() and not sys.stdout.isatty():
        outcomes = _with_progress(outcomes)
    lines = _json_lines(outcomes) if arguments.json else _table_lines(outcomes, bundle, arguments.files)
    refused = False
    for outcome, line in lines:
        print(line, flush=True)
        refused = refused or isinstance(outcome, Refused)
    return REFUSED if refused else OK


def check(arguments: argparse.Namespace) -> int:
    """Verify the bundle, warm up, recognise the built-in cluster and print what each stage took."""
    bundle, pipeline = _open(arguments.bundle)
    _print_bundle(bundle)
    started = time.perf_counter()
    _try_everything(pipeline)
    print(f"warm after {(time.perf_counter() - started) * 1e3:.0f} ms\n")
    contact = sample_contact()
    runs = [pipeline.run(contact, Options()) for _ in range(CHECK_RUNS)]
    layout = columns([contact.contact_id], [vessel.name for vessel in bundle.catalogue])
    print(title_line(layout), answer_line(layout, contact.contact_id, runs[-1]), sep="\n", end="\n\n")
    _print_stages([run.stage_ms for run in runs], len(contact.points_level))
    return OK


def verify(arguments: argparse.Namespace) -> int:
    """Compare every file of a bundle with its manifest, and what the stages read with what is there."""
    bundle = load_bundle(arguments.folder)
    _print_bundle(bundle)
    _try_everything(Pipeline(bundle))
    for name, model in bundle.models.items():
        inputs, outputs = (", ".join(map(str, side)) for side in (model.signature.inputs, model.signature.outputs))
        print(f"  {name}: {inputs} -> {outputs}")
    print("every file is as the manifest says, and every preset and image method runs")
    return OK


def loadtest(arguments: argparse.Namespace) -> int:
    """Test a running service as its client."""
    try:
        from shipshape.loadtest.command import loadtest as run  # noqa: PLC0415  its libraries are an extra
    except ModuleNotFoundError as error:
        raise SettingsError(
            f"expected the libraries of the extra shipshape[loadtest] to be installed, got no {error.name}"
        ) from error
    return run(arguments)


def token(arguments: argparse.Namespace) -> int:
    """Print a fresh token, which is kept nowhere, and the line that lets its holder in."""
    name, fresh = check_name(arguments.name), fresh_token()
    print(f"token: {fresh}")
    print(f"line:  {name} {hash_of(fresh)}")
    return OK


COMMANDS: Mapping[str, Callable[[argparse.Namespace], int]] = {
    "classify": classify,
    "check": check,
    "bundle verify": verify,
    "loadtest": loadtest,
    "token": token,
    "admin": admin,
}


def _options(arguments: argparse.Namespace) -> Options:
    method: ImageMethod | None = arguments.image_method
    if method is None:
        return Options(arguments.preset)
    if arguments.preset is not Preset.PAPER:
        raise SettingsError(f"expected --image-method with --preset paper alone, got --preset {arguments.preset}")
    return Options(arguments.preset, method)


def _open(folder: Path | None) -> tuple[Bundle, Pipeline]:
    cv2.setNumThreads(1)  # as in the service: a contact is one core's work
    bundle = load_bundle(folder or load_settings().bundle)
    return bundle, Pipeline(bundle)


def _warm_up(pipeline: Pipeline, options: Options) -> None:
    """The first run compiles and fills caches; its time says nothing about the next.

    Raises:
        BundleError: the built-in cluster got no answer, whatever the cause: it is a good one.
    """
    try:
        pipeline.run(sample_contact(), options)
    except BundleError:
        raise
    except Exception as error:
        cause = " ".join(f"{type(error).__name__}: {error}".split())
        raise BundleError(f"expected the bundle to answer the built-in cluster, got {cause:.160}") from error


def _try_everything(pipeline: Pipeline) -> None:
    """Run whatever a request can ask for; raises BundleError when a network or parameter is not there."""
    _warm_up(pipeline, Options(Preset.BEST))
    for method in ImageMethod:
        _warm_up(pipeline, Options(Preset.PAPER, method))


Lines = Iterator[tuple[Outcome | None, str]]


def _json_lines(outcomes: Iterable[Outcome]) -> Lines:
    for outcome in outcomes:
        yield outcome, orjson.dumps(to_record(outcome)).decode()


def _table_lines(outcomes: Iterable[Outcome], bundle: Bundle, files: list[Path]) -> Lines:
    names = [readable(f"{file} 0000" if file.suffix == ".npz" else file) for file in files]
    layout = columns(names, [vessel.name for vessel in bundle.catalogue])
    yield None, title_line(layout)
    for outcome in outcomes:
        many = outcome.index is not None and outcome.total > 1
        name = readable(f"{outcome.file} {outcome.index}" if many else outcome.file)
        if isinstance(outcome, Answered):
            yield outcome, answer_line(layout, name, outcome.recognition)
        else:
            yield outcome, refusal_line(layout, name, outcome.error)


def _drawn(outcomes: Iterable[Outcome], folder: Path) -> Iterator[Outcome]:
    pictures = PictureFolder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for outcome in outcomes:
            if isinstance(outcome, Answered):
                pictures.path(outcome).write_bytes(render_png(outcome.contact, outcome.recognition))
            yield outcome
    except OSError as error:
        raise FileError(f"expected to write pictures into {folder}, got: {error.strerror}") from error


def _with_progress(outcomes: Iterable[Outcome]) -> Iterator[Outcome]:
    """One line on the terminal that counts along while the answers go elsewhere."""
    shown = 0.0
    for outcome in outcomes:
        if outcome.index is not None and time.monotonic() - shown > PROGRESS_STEP_S:
            shown = time.monotonic()
            filled = 30 * (outcome.index + 1) // outcome.total
            bar = f"{'█' * filled}{'░' * (30 - filled)} {outcome.index + 1}/{outcome.total}"
            print(f"\r\x1b[K{bar} {readable(outcome.file.name)}", end="", file=sys.stderr, flush=True)
        yield outcome
    print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def _print_bundle(bundle: Bundle) -> None:
    vessels = ", ".join(vessel.name for vessel in bundle.catalogue)
    print(f"bundle {bundle.name} ({bundle.digest[:12]}): {vessels}; {len(bundle.models)} models")


def _print_stages(runs: list[Mapping[str, float]], points: int) -> None:
    medians = {name: statistics.median(run[name] for run in runs) for name in runs[0]}
    for name, ms in medians.items():
        print(f"{name:16}{ms:8.2f} ms")
    total = statistics.median(sum(run.values()) for run in runs)
    print(f"{'total':16}{total:8.2f} ms, median of {len(runs)} runs on {points} points")
