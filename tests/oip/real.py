"""The service with the shipped bundle, where answers differ from contact to contact."""

from pathlib import Path

import pytest

from serving.fakes import running
from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.render import render_png
from shipshape.serving.local_model import LocalModel

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture(scope="module")
def real():
    """Its doors."""
    if not (MODELS / "manifest.toml").is_file():
        pytest.skip("models/ has no manifest.toml yet")
    with running(opened=False) as doors:
        bundle = load_bundle(MODELS)
        doors.service.open(LocalModel(bundle, Pipeline(bundle), render_png))
        yield doors
