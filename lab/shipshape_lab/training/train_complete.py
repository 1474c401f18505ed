"""Train a classifier on complete clouds of the training hulls, as section 3.3.2 of the paper says.

    python -m shipshape_lab.training.train_complete --model full_side --data runs/data --out runs/experiment_2

Each hull gives one complete cloud in its true pose, encoded and lifted by an image method as a restored cloud is;
each of its many densest points is a training sample. METHOD gives bundle/complete_METHOD.onnx. The model `raw` is
a control that the paper does not have: the complete surface itself, seen at random headings, for raw clusters.
The shipped classifiers are trained on restored clouds instead (section 4.1.2), by `train_spd2`.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from shipshape import frames, raster
from shipshape.stages import keypoints, lifting, projection, spd2
from shipshape.stages.keypoints import KeypointParams
from shipshape.types import ImageMethod, Pose, ReferenceBox
from shipshape_lab.simulator.clusters import load, load_surfaces
from shipshape_lab.training import arguments, loop, train_spd2
from shipshape_lab.training.nets import Spd2Net

EPOCHS = 8
RAW = "raw"
KEYPOINTS = 64  # "numerous high-density interest points across the entire vessel structure"
RAW_POINTS = 4_000  # of a complete surface, so that it is about as dense as a lifted image
Described = tuple[np.ndarray, np.ndarray]  # SPD2 images (k, 5, 16, 32) float16 and a label for each


def encoded(surface_vessel: np.ndarray, method: ImageMethod, box: ReferenceBox, longest: float) -> np.ndarray:
    """The complete surface after projection and lifting, nothing inpainted.

    Args:
        surface_vessel: (s, 3), vessel frame, m.
        method: the image.
        box: reference box of its class, as in the pose of a restored cloud.
        longest: length of the longest vessel of the catalogue, m.

    Returns:
        (m, 3) float32, vessel frame, m.
    """
    pose = Pose(0.0, (0.0, 0.0, 0.0), box)
    frame = projection.paper_frame(method, box, longest)
    layers = projection.project(surface_vessel, pose, frame)
    grey = raster.to_grey(layers.count > 0, layers.top, frame)
    return lifting.lift_grey(grey, grey, pose, frame).points_level


def describe_many(points: np.ndarray) -> np.ndarray:
    """SPD2 images (k, 5, 16, 32) of up to KEYPOINTS densest points."""
    densest = keypoints.select_keypoints(points, KeypointParams(limit=KEYPOINTS))
    return spd2.describe(points, densest, train_spd2.RADIUS)


def of_method(method: ImageMethod, boxes: list[ReferenceBox]) -> Callable:
    """How `collect` describes a hull for an image method."""
    longest = max(box.length for box in boxes)

    def describe(surface: np.ndarray, label: int, rng: np.random.Generator) -> np.ndarray:
        return describe_many(encoded(surface, method, boxes[label], longest))

    return describe


def of_raw(surface: np.ndarray, label: int, rng: np.random.Generator) -> np.ndarray:
    """The surface at two random headings, as nothing is known of a raw cluster's."""
    points = rng.choice(surface, RAW_POINTS, replace=False)
    turned = (frames.to_level(points, angle, (0.0, 0.0, 0.0)) for angle in rng.uniform(-np.pi, np.pi, 2))
    return np.concatenate([describe_many(cloud) for cloud in turned])


def hulls(folder: Path, names: list[str]) -> Iterator[tuple[np.ndarray, int]]:
    """Complete surface (s, 3), vessel frame, m, and label of every training hull of the catalogue."""
    surfaces = load_surfaces(folder / "train_surfaces.npz")
    rows = [row for row, name in enumerate(surfaces.name) if str(name) in names]
    for row in tqdm(rows, desc="complete clouds", mininterval=2.0):
        yield surfaces.points[row], names.index(str(surfaces.name[row]))


def collect(folder: Path, names: list[str], describe: Callable, seed: int) -> Described:
    """Images and labels of every training hull."""
    images, labels = [], []
    for number, (surface, label) in enumerate(hulls(folder, names)):
        found = describe(surface, label, np.random.default_rng([seed, number]))
        images.append(found.astype(np.float16))
        labels.append(np.full(len(found), label, np.int64))
    return np.concatenate(images), np.concatenate(labels)


def main(argv: list[str] | None = None) -> None:
    """Train, or go on training, and export complete_MODEL.onnx."""
    args = arguments.parse(__doc__, argv, epochs=EPOCHS, model=[*ImageMethod, RAW])
    vessels = load(args.data / "train.npz").vessels
    boxes = [vessel.box for vessel in vessels]
    describe = of_raw if args.model == RAW else of_method(ImageMethod(args.model), boxes)
    images, labels = collect(args.data, [vessel.name for vessel in vessels], describe, args.seed)
    data = loop.Drawn(
        np.arange(len(labels)),
        lambda i, rng: {"images": images[i].astype(np.float32), "label": labels[i]},
        args.seed,
    )
    torch.manual_seed(args.seed)
    name, schedule = f"complete_{args.model}", loop.Schedule(args.epochs, batch=256, seed=args.seed)
    net = loop.train(
        Spd2Net(len(vessels)), data, train_spd2.loss_of, schedule, args.out / f"checkpoints/{name}.pt"
    )
    train_spd2.write(net, args.out / "bundle", name)


if __name__ == "__main__":
    main()
