"""What a fleet's bundle says of scans that no training showed: accuracy, heading, unknown, confusions.

python -m shipshape_lab.fleet.evaluate --catalogue fleet.toml --bundle fleet/bundle --out fleet/evaluation.json
"""

import argparse
import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.stats import mannwhitneyu
from tqdm import tqdm

from shipshape.bundle import UNKNOWN, load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.types import Contact
from shipshape_lab import metrics
from shipshape_lab.fleet import scans
from shipshape_lab.simulator.catalogue import read_catalogue
from shipshape_lab.simulator.clusters import ClusterSet

REFUSED = "refused"
BANDS = (0.0, 50.0, 80.0, 110.5, 150.0, 201.0)  # m
Numbers = dict[str, float]


@dataclass(frozen=True)
class Said:
    """The answers to M scans, one entry a scan.

    Attributes:
        vessel: the catalogue's vessel that fits best; REFUSED where the service takes the cluster for none.
        unknown: whether the answer is rather that it is none of them.
        chance: probability of `vessel`; NaN where refused.
        unknown_chance: probability of "unknown"; NaN where refused.
        heading: radians; NaN where refused.
    """

    vessel: np.ndarray
    unknown: np.ndarray
    chance: np.ndarray
    unknown_chance: np.ndarray
    heading: np.ndarray


def ask(pipeline: Pipeline, found: ClusterSet, title: str) -> Said:
    """The pipeline's answer to every cluster; the height of the sensor is not told."""
    rows = []
    for i in tqdm(range(len(found)), desc=title, mininterval=2.0):
        try:
            said = pipeline.run(Contact(found.cluster(i)))
        except InvalidInput:
            rows.append((REFUSED, True, np.nan, np.nan, np.nan))
            continue
        rows.append((said.vessel, said.unknown, said.probability, said.probabilities[UNKNOWN], said.heading))
    return Said(*(np.array(column) for column in zip(*rows, strict=True)))


def numbers_of(found: ClusterSet, said: Said) -> Numbers:
    """Shares in [0, 1] over the scans of the catalogue's vessels; refused scans count as wrong.

    Keys: clusters, refused, accuracy (the best of the catalogue, whatever the chance of unknown), accuracy_named
    (the right name, and not called unknown), both by band of range too; heading, bow_stern, ece, known_kept,
    unknown_found, auroc (unknown against known by the probability of unknown).
    """
    true = np.array([found.name(i) for i in range(len(found))])
    known, answered = found.label < len(found.catalogue), said.vessel != REFUSED
    right = said.vessel == true
    error = metrics.heading_error_deg(said.heading, found.heading)
    numbers = {
        "clusters": int(known.sum()),
        "refused": int((known & ~answered).sum()),
        "accuracy": right[known].mean(),
        "accuracy_named": (right & ~said.unknown)[known].mean(),
        "heading.median_deg": np.nanmedian(error[known]),
        "heading.within_5deg": (error <= 5.0)[known].mean(),
        "bow_stern": metrics.bow_right(said.heading, found.heading)[known].mean(),
        "ece": metrics.calibration_error(said.chance[known & answered], right[known & answered]),
        "known_kept": (~said.unknown & answered)[known].mean(),
        "unknown_found": said.unknown[~known].mean(),
        "auroc": _auroc(said.unknown_chance[known & answered], said.unknown_chance[~known & answered]),
    }
    for low, high in pairwise(BANDS):
        band = known & (found.range_m >= low) & (found.range_m < high)
        if band.any():
            numbers[f"accuracy.{low:.0f}_{high:.0f}m"] = right[band].mean()
    return {key: value if isinstance(value, int) else round(float(value), 5) for key, value in numbers.items()}


def _auroc(known: np.ndarray, unknown: np.ndarray) -> float:
    """Chance that something unknown gets a higher probability of unknown than something known."""
    return float(mannwhitneyu(unknown, known).statistic / (len(known) * len(unknown)))


def confusion(found: ClusterSet, said: Said) -> list[list[int]]:
    """Counts: a row for each vessel of the catalogue and one for all else, columns likewise: what was answered."""
    names = [*map(str, found.catalogue), UNKNOWN]
    answer = np.where(said.unknown, UNKNOWN, said.vessel)
    true = np.minimum(found.label, len(names) - 1)
    return [[int(((true == row) & (answer == name)).sum()) for name in names] for row in range(len(names))]


def main(argv: list[str] | None = None) -> None:
    """Scan, ask, count and write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--catalogue", type=Path, required=True, help="TOML file of the fleet")
    parser.add_argument("--bundle", type=Path, required=True, help="folder of its bundle")
    parser.add_argument("--out", type=Path, required=True, help="JSON file to write")
    args = parser.parse_args(argv)
    catalogue, bundle = read_catalogue(args.catalogue), load_bundle(args.bundle)
    pipeline = Pipeline(bundle)
    content: dict = {"bundle": bundle.name, "bundle_digest": bundle.digest, "names": list(catalogue.names)}
    for name, make in (("calm", scans.calm), ("hard", scans.hard)):
        found = make(catalogue)
        said = ask(pipeline, found, f"recognise {name}")
        content[name] = {"numbers": numbers_of(found, said), "confusion": confusion(found, said)}
    args.out.parent.mkdir(parents=True, exist_ok=True)
    draft = args.out.with_suffix(".part")
    draft.write_text(json.dumps(content, indent=2) + "\n")
    draft.replace(args.out)


if __name__ == "__main__":
    main()
