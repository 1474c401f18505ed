"""Train one peer on the data of preset `best`, fit its temperature on the validation set, and write both.

    python -m shipshape_lab.peers.train --model pointnet --data runs/data --out runs/peers
    python -m shipshape_lab.peers.train --model pointnet2 --data runs/data --out runs/peers
    python -m shipshape_lab.peers.train --model mirrored_spd2 --data runs/data --out runs/peers --bundle models

The schedule is that of the networks of preset `best`: AdamW, one cycle with a peak rate of 2e-3, batches of 64,
examples drawn afresh every epoch (mirrored or not, thinned or not, sensor height told or not), label smoothing
0.02. On 40,000 clusters that is 8 epochs or 320,000 examples for pointnet, 7 or 280,000 for pointnet2; the
networks of `best` see more: the first look 360,000, the aligned looks 400,000, the restorer 600,000. mirrored_spd2
is trained as the classifier of restored clouds is: 8 keypoints a cluster described once, 4 epochs, batches of 256.
It needs the trained pose of preset `best`, from any folder with points.onnx and aligned.onnx.

Stopped and started again, training goes on after the last whole epoch.
"""

import argparse
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from shipshape_lab.commit import code_commit
from shipshape_lab.peers import mirrored
from shipshape_lab.peers.clouds import network_inputs
from shipshape_lab.peers.load import NETWORKS, answering
from shipshape_lab.peers.validate import validated
from shipshape_lab.training import arguments, loop, train_spd2, weights
from shipshape_lab.training.examples import Examples

EPOCHS = {"pointnet": 8, "pointnet2": 7, "mirrored_spd2": 4}


def loss_of(net: nn.Module, batch: dict[str, Tensor]) -> Tensor:
    """Cross-entropy."""
    logits = net(batch["points"], batch["count"], batch["features"]).float()
    return nn.functional.cross_entropy(logits, batch["label"], label_smoothing=0.02)


def of_points(examples: Examples, seed: int) -> loop.Drawn:
    """Training data of the point networks."""

    def draw(i: int, rng: np.random.Generator) -> dict:
        example = examples.drawn(i, rng)
        return network_inputs(example.contact, rng) | {"label": example.label}

    return loop.Drawn(examples.indices, draw, seed)


def of_descriptors(examples: Examples, folder: Path, seed: int) -> loop.Drawn:
    """Training data of mirrored cloud + SPD2."""
    describe = mirrored.describe_with(mirrored.pose_pipeline(folder, examples.catalogue))
    images, labels = train_spd2.collect(examples, describe, seed)
    return loop.Drawn(
        np.arange(len(labels)),
        lambda i, rng: {"images": images[i].astype(np.float32), "label": labels[i]},
        seed,
    )


def trained(args: argparse.Namespace, examples: Examples) -> nn.Module:
    """The network, trained."""
    net = NETWORKS[args.model](len(examples.catalogue) + 1)
    checkpoint = args.out / f"checkpoints/{args.model}.pt"
    epochs = args.epochs or EPOCHS[args.model]
    if args.model != "mirrored_spd2":
        schedule = loop.Schedule(epochs, seed=args.seed)
        return loop.train(net, of_points(examples, args.seed), loss_of, schedule, checkpoint)
    folder = args.out / args.model
    mirrored.keep_pose_networks(args.bundle, folder)
    data = of_descriptors(examples, folder, args.seed)
    schedule = loop.Schedule(epochs, batch=256, seed=args.seed)
    return loop.train(net, data, train_spd2.loss_of, schedule, checkpoint)


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, validate and write."""
    args = _arguments(argv)
    torch.manual_seed(args.seed)
    examples = Examples.read(args.data, "train")
    net, folder = trained(args, examples), args.out / args.model
    validation = Examples.read(args.data, "validation")
    temperature, scores = validated(answering(folder, net, examples.catalogue), validation, seed=args.seed)
    about = {
        "temperature": temperature,
        "validation": scores,
        "catalogue": [asdict(vessel) for vessel in examples.catalogue],
        "training": {"seed": args.seed, "commit": code_commit(), "clusters": len(examples)},
    }
    weights.write(folder, net, "peer.json", about)
    print(f"{args.model} in {folder}: temperature {temperature:.3f}, {scores}")


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", choices=list(NETWORKS), required=True, help="which peer")
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument(
        "--out", type=Path, required=True, help="folder for checkpoints/ and a folder for each peer"
    )
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="mirrored_spd2: networks of the pose")
    parser.add_argument("--epochs", type=int, help=f"passes over the data (default {EPOCHS})")
    return arguments.prepared(parser, argv)


if __name__ == "__main__":
    main()
