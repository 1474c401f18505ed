"""What every peer computes, and the small answer that every peer gives."""

import os
from pathlib import Path

import cv2
import numpy as np

from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.sample import sample_contact
from shipshape.types import Contact

HOST = "127.0.0.1"
PORT = int(os.environ.get("PORT", "0"))
CORES = int(os.environ.get("CORES", "1"))  # that the server may use: one worker process each


def load() -> Pipeline:
    """The pipeline of the default bundle, warm."""
    cv2.setNumThreads(1)
    pipeline = Pipeline(load_bundle(Path("models")))
    pipeline.run(sample_contact())
    return pipeline


def from_bytes(packed: bytes) -> np.ndarray:
    """Little-endian float32 x y z -> (n, 3)."""
    return np.frombuffer(packed, "<f4").reshape(-1, 3)


def recognise(pipeline: Pipeline, points_level: np.ndarray) -> dict:
    """Vessel, probability, heading and box of one contact, ready for JSON."""
    found = pipeline.run(Contact(np.asarray(points_level, np.float32)))
    size = found.box.size
    return {
        "vessel": found.vessel,
        "probability": found.probability,
        "heading": found.heading,
        "box": [*found.box.center_level, size.length, size.beam, size.height],
    }
