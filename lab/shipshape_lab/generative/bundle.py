r"""Write a bundle whose restorer is the generative one: the service runs it as it runs any other.

python -m shipshape_lab.generative.bundle --flow runs/generative/flow_4.onnx --data runs/data \
  --to runs/generative/bundle_4

All networks are the base bundle's but inpainting.onnx: the flow, its steps unrolled, its noise drawn once by
--seed and kept in the file, so that one cluster always gets one answer. What is calibrated is calibrated again
on the validation set of --data, since the restorer's evidence weighs otherwise; without --data the base's
numbers stay.
"""

import argparse
import shutil
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

from shipshape.bundle import Bundle, load_bundle
from shipshape.bundle_writer import write_manifest
from shipshape_lab.commit import code_commit
from shipshape_lab.training.calibrate import calibrated
from shipshape_lab.training.examples import Examples
from shipshape_lab.training.partial import partial_bundle

NOISE = "noise"


def with_kept_noise(source: Path, seed: int) -> onnx.ModelProto:
    """The flow at `source` with its input of noise turned into a constant that `seed` draws.

    Raises:
        ValueError: the file has no such input.
    """
    model = onnx.load(source)
    given = {entry.name: entry for entry in model.graph.input}
    if NOISE not in given:
        raise ValueError(f"expected an input {NOISE} in {source}, got {', '.join(given)}")
    shape = [1] + [size.dim_value for size in given[NOISE].type.tensor_type.shape.dim[1:]]
    noise = np.random.default_rng(seed).standard_normal(shape, np.float32)
    model.graph.input.remove(given[NOISE])
    model.graph.initializer.append(numpy_helper.from_array(noise, NOISE))
    return model


def write(base: Path, flow: Path, to: Path, *, seed: int, data: Path | None = None) -> Bundle:
    """The bundle in the folder `to`, read back and verified.

    Args:
        base: folder of a finished bundle.
        flow: a file that `generative.train` exported.
        to: folder of the new bundle.
        seed: of the noise, and of the draws of the validation set.
        data: folder whose validation set it is calibrated on; None keeps what the base was calibrated to.

    Raises:
        ValueError: `to` is the base's own folder, or `flow` takes no noise.
    """
    if to.resolve() == base.resolve():
        raise ValueError(f"expected another folder than that of the base bundle, got {to}")
    old, model = load_bundle(base), with_kept_noise(flow, seed)
    to.mkdir(parents=True, exist_ok=True)
    for name in old.models:
        shutil.copyfile(base / f"{name}.onnx", to / f"{name}.onnx")
    onnx.save(model, to / "inpainting.onnx")
    parameters, scores = old.parameters, old.scores
    if data is not None:
        parameters, scores = calibrated(
            partial_bundle(to, old.catalogue), Examples.read(data, "validation"), seed=seed
        )
    restorer = {"restorer": flow.stem, "restorer_commit": code_commit(), "noise_seed": seed, "base": old.digest}
    return write_manifest(
        to,
        name=f"{old.name}_{flow.stem}",
        training={**old.training, **restorer, "calibrated_again": data is not None},
        catalogue=old.catalogue,
        models={name: Path(f"{name}.onnx") for name in old.models},
        parameters=parameters,
        scores=scores,
    )


def main(argv: list[str] | None = None) -> None:
    """Write, verify, and say what it is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", type=Path, default=Path("models"), help="finished bundle (default models)")
    parser.add_argument("--flow", type=Path, required=True, help="flow_N.onnx of generative.train")
    parser.add_argument("--data", type=Path, help="folder of the data sets, to calibrate again")
    parser.add_argument("--to", type=Path, required=True, help="folder of the new bundle")
    parser.add_argument("--seed", type=int, default=1, help="seed of the noise and of calibration (default 1)")
    args = parser.parse_args(argv)
    bundle = write(args.base, args.flow, args.to, seed=args.seed, data=args.data)
    print(f"bundle {bundle.name} {bundle.digest[:12]} with {len(bundle.models)} networks in {args.to}")


if __name__ == "__main__":
    main()
