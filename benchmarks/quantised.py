"""What int16 points save and cost: bytes of a message, and what becomes of the answers of `best`.

    shipshape-lab data H --count 1000 --out runs/data
    python benchmarks/quantised.py runs/data/H.npz --bundle models --out runs/results

Counts bytes of whole `RecogniseRequest` messages, as they are and gzipped as gRPC would. The file holds
the truth beside its clusters, as the lab's sets do; "unknown" is right for a vessel that the bundle does not know.
Writes OUT/quantised.json.
"""

import argparse
import gzip
import json
import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from shipshape.bundle import UNKNOWN, load_bundle
from shipshape.frames import wrap_angle, wrap_half_turn
from shipshape.pipeline import Pipeline
from shipshape.pointfiles import read_clusters
from shipshape.quantised import dequantise, quantise
from shipshape.types import Contact, Recognition
from shipshape.v1 import shipshape_pb2 as pb

GOLDEN = Path(__file__).parents[1] / "tests/golden/clusters.npz"
FORMS: dict[str, float | None] = {"int16, finest steps": None, "int16, 1 cm": 0.01, "int16, 5 cm": 0.05}
FLOAT32 = "float32"
GZIP_LEVEL = 6  # zlib's own, which gRPC uses


@dataclass(frozen=True)
class Sent:
    """One cluster in one form: what went over the wire, and what was made of it."""

    bytes: int
    gzipped: int
    moved_m: float  # the farthest that a coordinate moved
    answer: Recognition


def send(pipeline: Pipeline, contact: Contact, scale: float | None, *, whole: bool) -> Sent:
    """The contact in int16 steps of `scale` metres, or `whole` in float32."""
    message = pb.Contact(sensor_height_m=contact.sensor_height)
    points = contact.points_level
    if whole:
        message.points = points.astype("<f4").tobytes()
    else:
        quantised = quantise(points, scale)
        x, y, z = quantised.origin_level
        message.points_int16, message.scale = quantised.steps, quantised.scale
        message.origin.CopyFrom(pb.Point(x=x, y=y, z=z))
        points = dequantise(quantised)
    packed = pb.RecogniseRequest(contact=message).SerializeToString()
    moved = float(np.abs(points.astype(np.float64) - contact.points_level).max())
    answer = pipeline.run(replace(contact, points_level=points))
    return Sent(len(packed), len(gzip.compress(packed, GZIP_LEVEL)), moved, answer)


def compare(sent: list[Sent], reference: list[Sent], truth: dict[str, np.ndarray]) -> dict[str, float]:
    """Bytes, how often the answers are right, and how often and how far they differ from the reference's."""
    pairs = [(one.answer, other.answer) for one, other in zip(sent, reference, strict=True)]
    off = [
        abs(math.degrees(wrap_half_turn(a.heading - float(true))))
        for (a, _), true in zip(pairs, truth["heading"], strict=True)
    ]
    turned = np.array([abs(math.degrees(wrap_angle(a.heading - b.heading))) for a, b in pairs])
    return {
        "bytes": float(np.mean([each.bytes for each in sent])),
        "gzipped": float(np.mean([each.gzipped for each in sent])),
        "moved_mm": 1e3 * max(each.moved_m for each in sent),
        "right": float(
            np.mean([_right(a, true) for (a, _), true in zip(pairs, truth["vessel"].tolist(), strict=True)])
        ),
        "heading_error_deg_median": float(np.median(off)),
        "heading_error_deg_p95": float(np.quantile(off, 0.95)),
        "same_verdict": float(np.mean([_verdict(a) == _verdict(b) for a, b in pairs])),
        "probability_p99": float(np.quantile([abs(a.probability - b.probability) for a, b in pairs], 0.99)),
        "heading_deg_median": float(np.median(turned)),
        "heading_deg_p99": float(np.quantile(turned, 0.99)),
        "heading_deg_max": float(turned.max()),
    }


def _right(answer: Recognition, vessel: str) -> bool:
    return _verdict(answer) == (vessel if vessel in answer.probabilities else UNKNOWN)


def _verdict(answer: Recognition) -> str:
    return UNKNOWN if answer.unknown else answer.vessel


def main() -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="?", type=Path, default=GOLDEN, help="clusters (default: tests/golden)")
    parser.add_argument("--bundle", type=Path, default=Path("models"))
    parser.add_argument("--out", type=Path, default=Path("runs/results"))
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    pipeline = Pipeline(load_bundle(arguments.bundle))
    sent: dict[str, list[Sent]] = {name: [] for name in (FLOAT32, *FORMS)}
    with np.load(arguments.file, allow_pickle=False) as saved:
        truth = {name: saved[name] for name in ("heading", "sensor_height")}
        truth["vessel"] = saved["vessel"] if "vessel" in saved else saved["classes"][saved["label"]]
    clusters = tqdm(read_clusters(arguments.file), unit="cluster", disable=not sys.stderr.isatty())
    for points, height in zip(clusters, truth["sensor_height"].tolist(), strict=True):
        contact = Contact(points, sensor_height=height)
        for name, answers in sent.items():
            answers.append(send(pipeline, contact, FORMS.get(name), whole=name == FLOAT32))
    found = {name: compare(each, sent[FLOAT32], truth) for name, each in sent.items()}
    print(f"{len(sent[FLOAT32])} clusters of {arguments.file.name}\n")
    for name, row in found.items():
        print(f"{name:20} " + "  ".join(f"{key} {value:.4g}" for key, value in row.items()))
    arguments.out.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"clusters": len(sent[FLOAT32]), "file": arguments.file.name, "forms": found}, indent=2)
    (arguments.out / "quantised.json").write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
