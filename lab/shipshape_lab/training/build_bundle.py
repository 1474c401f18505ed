"""Quantise the trained networks, calibrate them on the validation set and write them as a verified bundle.

python -m shipshape_lab.training.build_bundle --data runs/data --out runs/default --to models
"""

import argparse
import shutil
from pathlib import Path

from shipshape.bundle import Bundle
from shipshape.bundle_writer import write_manifest
from shipshape_lab.commit import code_commit
from shipshape_lab.simulator.catalogue import same_vessels
from shipshape_lab.simulator.clusters import load_catalogue
from shipshape_lab.training.calibrate import calibrated
from shipshape_lab.training.examples import Examples
from shipshape_lab.training.partial import partial_bundle
from shipshape_lab.training.quantise import quantise_all


def build(data: Path, networks: Path, to: Path, *, seed: int, name: str = "default") -> Bundle:
    """The finished bundle in the folder `to`, read back and verified.

    Args:
        data: folder of the data sets.
        networks: folder of the trained networks.
        to: folder of the bundle.
        seed: of the draws of the validation set.
        name: of the bundle, as the service reports it.

    Raises:
        ValueError: the networks were trained for another catalogue than the validation set's.
    """
    commit = code_commit()  # before anything is written: `to` may be part of the checkout
    validation = Examples.read(data, "validation")
    trained = load_catalogue(data / "train.npz")
    if not same_vessels(trained, validation.catalogue):
        names = (", ".join(vessel.name for vessel in vessels) for vessels in (trained, validation.catalogue))
        raise ValueError("{} must hold one catalogue, but train has {} and validation {}".format(data, *names))
    shipped = networks.with_name("shipped")
    quantise_all(networks, shipped, Examples.read(data, "train"), seed=seed)
    parameters, scores = calibrated(partial_bundle(shipped, validation.catalogue), validation, seed=seed)
    to.mkdir(parents=True, exist_ok=True)
    files = sorted(shipped.glob("*.onnx"))
    for file in files:
        shutil.copyfile(file, to / file.name)
    return write_manifest(
        to,
        name=name,
        training={"commit": commit, "seed": seed, "validation_clusters": len(validation)},
        catalogue=validation.catalogue,
        models={file.stem: Path(file.name) for file in files},
        parameters=parameters,
        scores=scores,
    )


def main(argv: list[str] | None = None) -> None:
    """Calibrate and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--out", type=Path, required=True, help="folder whose bundle/ holds the trained networks")
    parser.add_argument("--to", type=Path, required=True, help="folder of the finished bundle")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draws of the validation set")
    parser.add_argument("--name", default="default", help="name of the bundle (default: default)")
    args = parser.parse_args(argv)
    bundle = build(args.data, args.out / "bundle", args.to, seed=args.seed, name=args.name)
    print(f"bundle {bundle.name} {bundle.digest[:12]} with {len(bundle.models)} networks in {args.to}")
    for table, values in bundle.parameters.items():
        print(f"  {table}: {values}")
    print(f"  scores: {bundle.scores}")


if __name__ == "__main__":
    main()
