"""Put every cluster of a test set to every system, keep what they said, and work out the numbers.

    python -m shipshape_lab.experiments.evaluate --set H --data runs/data --bundle models --out runs/results

Leaves OUT/H.npz with all answers and OUT/recognition_h.json with the numbers. Stopped runs go on where they were;
of a finished one only the numbers are worked out again. Peers are asked where --peers holds trained ones. The
paper's image methods are not asked about set U: they know no "unknown".
"""

import argparse
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape.bundle import Bundle, load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, Options
from shipshape_lab.experiments import hard, numbers, outcome, predictions, rejection
from shipshape_lab.experiments.predictions import Answers, Truth
from shipshape_lab.experiments.systems import BEST, IMAGE_METHODS, PEERS, RAW, Run, run_systems
from shipshape_lab.training.examples import Examples

SETS = ("P", "far", "H", "U")
HEADLINE = r"\w+\.(accuracy|error|reach_m|auroc|ece)\.\w+(\.overall)?"
SAVE_EVERY = 1000  # clusters: a minute of work to lose


def truth_of(examples: Examples, index: np.ndarray, key: list[str]) -> Truth:
    """What is true of the clusters `index` of a set."""
    clusters = examples.clusters
    poses = [examples.example(int(i)).pose for i in tqdm(index, desc="truth", leave=False)]
    return Truth(
        key=np.array(key),
        index=index,
        label=examples.labels[index],
        kind=clusters.classes[clusters.label[index]],
        lidar=clusters.lidar[index],
        hidden_share=clusters.hidden_share[index],
        range_m=clusters.range_m[index],
        aspect_deg=clusters.aspect_deg[index],
        heading=clusters.heading[index],
        center=np.array([pose.origin_level[:2] for pose in poses], np.float32),
        size=np.array([(pose.size.length, pose.size.beam, pose.size.height) for pose in poses], np.float32),
        points=clusters.n[index],
    )


class Panel:
    """The systems that are asked, and where their answers go.

    Args:
        pipeline: of the bundle.
        methods: the paper's image methods to ask.
        peers: trained peers.
    """

    def __init__(self, pipeline: Pipeline, methods: Sequence[str], peers: Sequence) -> None:
        self.pipeline, self._methods, self._peers = pipeline, methods, peers

    def keys(self, folder: Path) -> dict[str, str]:
        """What each system is, by name: digest of the bundle, or of the peer's files in `folder`."""
        own = dict.fromkeys((BEST, RAW, *self._methods), self.pipeline.bundle.digest)
        return own | {peer.name: predictions.digest_of_folder(folder / peer.name) for peer in self._peers}

    def ask(self, contact: Contact, answers: Answers, column: int) -> None:
        """Put a contact to every system that was not asked about it yet."""
        left = set(answers.system[~answers.done[:, column]].tolist())
        answers.done[:, column] = True
        rows = {name: row for row, name in enumerate(answers.system.tolist())}
        try:
            if left & {BEST, RAW, *self._methods}:
                runs = run_systems(self.pipeline, contact, self._methods)
                _write_probabilities(runs.pop(RAW).work.prior, answers, (rows[RAW], column))
                for name, run in runs.items():
                    self._write(run, answers, (rows[name], column))
            else:
                self.pipeline.begin(contact, Options())
        except InvalidInput:
            return  # the service refuses it: that counts as wrong for every system, peers too
        for peer in self._peers:
            if peer.name in left:
                _write_probabilities(peer.classify(contact), answers, (rows[peer.name], column))

    def _write(self, run: Run, answers: Answers, place: tuple[int, int]) -> None:
        said = self.pipeline.finish(run.work, run.stage_ms)
        answers.probabilities[place] = run.work.probabilities
        answers.unknown[place] = said.unknown
        answers.heading[place] = said.heading
        answers.heading_std[place] = said.heading_std
        answers.bow_probability[place] = said.bow_probability
        answers.center[place] = said.box.center_level[:2]
        answers.size[place] = said.box.size.length, said.box.size.beam, said.box.size.height


def _write_probabilities(probabilities: np.ndarray, answers: Answers, place: tuple[int, int]) -> None:
    answers.probabilities[place] = probabilities
    answers.unknown[place] = np.argmax(probabilities) == len(probabilities) - 1


def evaluate(examples: Examples, panel: Panel, answers: Answers, truth: Truth, path: Path) -> None:
    """Fill in the answers to every cluster of `truth`, kept in `path` on the way."""
    told = truth.key[-1] == "told"
    left = np.flatnonzero(~answers.done.all(axis=0))
    for turn, column in enumerate(tqdm(left, desc=path.stem, mininterval=2.0), start=1):
        i = int(truth.index[column])
        height = float(examples.clusters.sensor_height[i]) if told else None
        panel.ask(Contact(examples.clusters.cluster(i), sensor_height=height), answers, int(column))
        if turn % SAVE_EVERY == 0 or turn == len(left):
            predictions.save(path, truth, answers)


def load_peers(folder: Path | None) -> list:
    """The trained peers of a folder in the order of the tables; none without a folder."""
    if folder is None:
        return []
    from shipshape_lab.peers.load import load_peers as load  # noqa: PLC0415  peers need torch, the rest does not

    return sorted(load(folder), key=lambda peer: PEERS.index(peer.name))


def numbers_of(name: str, out: Path, bundle: Bundle) -> numbers.Numbers:
    """The numbers of a set from the answers in OUT; those of U need the answers to P.

    Raises:
        ValueError: the answers to P are missing or of another bundle.
    """
    truth, answers = predictions.load(out / f"{name}.npz")
    catalogue = [vessel.name for vessel in bundle.catalogue]
    if name == "H":
        return hard.of_answers(truth, answers, catalogue)
    if name == "U":
        known = out / "P.npz"
        if not known.exists():
            raise ValueError(f"expected {known}, which U is compared with, got none: evaluate --set P first")
        return rejection.of_answers((truth, answers), predictions.load(known))
    return numbers.of_answers(name, truth, answers, catalogue)


def main(argv: list[str] | None = None) -> None:
    """Command line: one pass over the set."""
    parser = _parser()
    args = parser.parse_args(argv)
    examples, bundle = Examples.read(args.data, args.set), load_bundle(args.bundle)
    index = np.arange(0, len(examples.clusters), args.every)
    height = "told" if args.sensor_height else "not told"
    truth = truth_of(examples, index, [predictions.digest_of(args.data / f"{args.set}.npz"), height])
    peers = [] if args.sensor_height else load_peers(args.peers)
    panel = Panel(Pipeline(bundle), () if args.set == "U" or args.sensor_height else IMAGE_METHODS, peers)
    name = f"{args.set}_height_told" if args.sensor_height else args.set
    path = args.out / f"{name}.npz"
    keys = panel.keys(args.peers)
    blank = Answers.empty(keys, len(index), len(bundle.catalogue) + 1)
    evaluate(examples, panel, predictions.resume(path, truth, blank), truth, path)
    try:
        found = numbers_of(name, args.out, bundle)
    except ValueError as error:
        parser.error(str(error))
    about = {**about_bundle(bundle), "every": args.every, "sensor_height": height, "systems": list(keys)}
    print(f"wrote {path} and {outcome.write(args.out, f'recognition_{name.lower()}', found, **about)}")
    wholes = [key for key in found if re.fullmatch(HEADLINE, key)]
    print("\n".join(f"{key:<32} {found[key]:.4f}" for key in wholes))


def about_bundle(bundle: Bundle) -> dict:
    """What a bundle is, for the results that were computed with it."""
    return {
        "bundle": bundle.name,
        "bundle_digest": bundle.digest,
        "catalogue": [vessel.name for vessel in bundle.catalogue],
        "training": dict(bundle.training),
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m shipshape_lab.experiments.evaluate",
        description="Puts a test set to every system and keeps answers and numbers in OUT.",
        epilog="example: python -m shipshape_lab.experiments.evaluate --set P --data runs/data --out runs/results",
    )
    parser.add_argument("--set", choices=SETS, required=True, help="the test set")
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--peers", type=Path, help="folder of trained peers; none are asked without it")
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument(
        "--every", type=int, default=1, help="only each Nth cluster; take an N that does not divide 360, such as 7"
    )
    parser.add_argument(
        "--sensor-height",
        action="store_true",
        help="tell the sensor's height above the water; `best` and raw alone",
    )
    return parser


if __name__ == "__main__":
    main()
