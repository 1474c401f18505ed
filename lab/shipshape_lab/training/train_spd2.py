"""Train a CNN on SPD2 images: the prior, the part labels, or the classifier of one restored image.

    python -m shipshape_lab.training.train_spd2 --model prior --data runs/data --out runs/default

Models: prior (raw clusters along the line of sight), parts (bow, middle or stern of the paper's aligned raw
cluster), spd2 (clouds restored by preset `best`), spd2_METHOD (clouds restored by one of the paper's methods).
The restored ones need the networks of the stages before them.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from tqdm import tqdm

from shipshape.bundle import CatalogueVessel
from shipshape.pipeline import Pipeline
from shipshape.stages import keypoints, spd2
from shipshape.stages.bow_stern import PARTS
from shipshape.stages.keypoints import KeypointParams
from shipshape.types import ImageMethod, Options, Preset, ReferenceBox
from shipshape_lab.training import arguments, export, loop
from shipshape_lab.training.examples import Example, Examples, is_accepted
from shipshape_lab.training.nets import Spd2Net
from shipshape_lab.training.partial import UNCALIBRATED, partial_bundle, run_until
from shipshape_lab.training.poses import paper_pose

EPOCHS = 2
KNOW_UNKNOWN = ("prior", "spd2")  # the others learn from the vessels of the catalogue alone
KEYPOINTS = 8  # more than the three of inference: each one is a training sample of its own (section 3.3.2)
RADIUS = UNCALIBRATED["common"]["spd2_radius"]
Described = tuple[np.ndarray, np.ndarray]  # SPD2 images (k, 5, 16, 32) and a label for each


def describe_densest(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The densest points of a cloud and their SPD2 images."""
    densest = keypoints.select_keypoints(points, KeypointParams(limit=KEYPOINTS))
    return densest, spd2.describe(points, densest, RADIUS)


def of_prior(pipeline: Pipeline) -> Callable[[Example, np.random.Generator], Described]:
    """Raw clusters in the sight frame."""

    def describe(example: Example, rng: np.random.Generator) -> Described:
        _, images = describe_densest(pipeline.begin(example.contact, Options()).points_sight)
        return images, np.full(len(images), example.label)

    return describe


def of_parts(boxes: list[ReferenceBox]) -> Callable[[Example, np.random.Generator], Described]:
    """Raw clusters in the paper's pose, half of them with bow and stern swapped, by where the keypoint is."""

    def describe(example: Example, rng: np.random.Generator) -> Described:
        pose = paper_pose(example, boxes)
        pose = pose.turned(math.pi) if rng.random() < 0.5 else pose
        densest, images = describe_densest(pose.to_vessel(example.contact.points_level))
        true_x = example.pose.to_vessel(pose.to_level(densest))[:, 0] / example.pose.size.length
        return images, np.digitize(-true_x, [-1 / 6, 1 / 6])

    return describe


def of_restored(pipeline: Pipeline, options: Options) -> Callable[[Example, np.random.Generator], Described]:
    """Clouds restored by the service's own stages."""

    def describe(example: Example, rng: np.random.Generator) -> Described:
        restored = run_until(pipeline, example.contact, options, "lifting")
        _, images = describe_densest(restored.pose.to_vessel(restored.restored.points_level))
        return images, np.full(len(images), example.label)

    return describe


def collect(examples: Examples, describe: Callable, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Images (M, 5, 16, 32) as float16 and labels (M,) of every cluster that the service accepts, drawn once."""
    images, labels = [], []
    for i in tqdm(examples.indices, desc="SPD2 images", mininterval=2.0):
        rng = np.random.default_rng([seed, i])
        example = examples.drawn(int(i), rng)
        if not is_accepted(example.contact):
            continue
        found, label = describe(example, rng)
        images.append(found.astype(np.float16))
        labels.append(label)
    return np.concatenate(images), np.concatenate(labels).astype(np.int64)


def loss_of(net: nn.Module, batch: dict[str, Tensor]) -> Tensor:
    """Cross-entropy."""
    return nn.functional.cross_entropy(net(batch["images"]).float(), batch["label"])


def source(model: str, folder: Path, catalogue: Sequence[CatalogueVessel]) -> tuple[Callable, int]:
    """How to describe an example for `model`, and its number of classes."""
    if model == "parts":
        return of_parts([vessel.box for vessel in catalogue]), len(PARTS)
    pipeline = Pipeline(partial_bundle(folder, catalogue))
    if model == "prior":
        return of_prior(pipeline), len(catalogue) + 1
    if model == "spd2":
        return of_restored(pipeline, Options(Preset.BEST)), len(catalogue) + 1
    method = ImageMethod(model.removeprefix("spd2_"))
    return of_restored(pipeline, Options(Preset.PAPER, method)), len(catalogue)


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, and export MODEL.onnx."""
    models = ["prior", "parts", "spd2", *(f"spd2_{method}" for method in ImageMethod)]
    args = arguments.parse(__doc__, argv, epochs=EPOCHS, model=models)
    examples = Examples.read(args.data, "train", catalogue_only=args.model not in KNOW_UNKNOWN)
    describe, classes = source(args.model, args.out / "bundle", examples.catalogue)
    images, labels = collect(examples, describe, args.seed)
    data = loop.Drawn(
        np.arange(len(labels)),
        lambda i, rng: {"images": images[i].astype(np.float32), "label": labels[i]},
        args.seed,
    )
    torch.manual_seed(args.seed)
    schedule = loop.Schedule(args.epochs, batch=256, seed=args.seed)
    net = loop.train(Spd2Net(classes), data, loss_of, schedule, args.out / f"checkpoints/{args.model}.pt")
    write(net, args.out / "bundle", args.model)


def write(net: nn.Module, folder: Path, name: str) -> None:
    """Export to NAME.onnx."""
    export.export(net, {"images": torch.rand(1, 5, 16, 32)}, ["logits"], folder / f"{name}.onnx")


if __name__ == "__main__":
    main()
