"""The systems that are compared, on the same contacts; those of the pipeline are run by the service's own stages.

`best` is the shipped default; `full_top`, `full_side`, `z_top` and `z_side` are preset `paper` with each of its
image methods; `raw_spd2` is the classifier of the raw cluster, which is the prior of preset `paper`. The peers are
what a user might take instead, trained on the same clusters: `pointnet`, `pointnet2` and `mirrored_spd2`.
"""

import copy
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from shipshape.pipeline import Pipeline
from shipshape.types import Contact, ImageMethod, Options, Preset
from shipshape.work import Work

BEST, RAW = "best", "raw_spd2"
IMAGE_METHODS = tuple(str(method) for method in ImageMethod)
PEERS = ("mirrored_spd2", "pointnet", "pointnet2")
SYSTEMS = (BEST, RAW, *PEERS, *IMAGE_METHODS)  # in the order of every table
RIVALS = (RAW, *PEERS)  # that the targets name, apart from the paper's method
PIPELINES = (BEST, *IMAGE_METHODS)  # those that go through every stage
PAPER_POSE = str(ImageMethod.FULL_SIDE)  # preset `paper` finds one pose for all of its image methods

_PRIOR = ("prior",)
_POSE = ("heading", "bow_stern")


@dataclass
class Run:
    """A contact on its way through one system, with the milliseconds of each stage."""

    work: Work
    stage_ms: dict[str, float] = field(default_factory=dict)

    def branch(self, options: Options) -> "Run":
        """The same work so far, to be gone on with under other options; stages replace fields, never edit them."""
        work = copy.copy(self.work)
        work.options = options
        return Run(work, dict(self.stage_ms))

    def through(self, pipeline: Pipeline, names: Iterable[str]) -> "Run":
        """Run the named stages."""
        wanted = set(names)
        for stage in pipeline.stages:
            if stage.name in wanted:
                started = time.perf_counter()
                stage.run(self.work)
                self.stage_ms[stage.name] = (time.perf_counter() - started) * 1e3
        return self


def run_systems(pipeline: Pipeline, contact: Contact, methods: Sequence[str] = IMAGE_METHODS) -> dict[str, Run]:
    """RAW as far as its answer, `best`, and preset `paper` with each of `methods` on one contact.

    What they share is computed once.

    Raises:
        InvalidInput: the contact cannot be one vessel's cluster.
    """
    started = Run(pipeline.begin(contact, Options()))
    raw = started.branch(Options(Preset.PAPER)).through(pipeline, _PRIOR)
    rest = [stage.name for stage in pipeline.stages if stage.name not in (*_PRIOR, *_POSE)]
    best = started.branch(Options(Preset.BEST)).through(pipeline, (*_PRIOR, *_POSE, *rest))
    runs = {RAW: raw, BEST: best}
    if methods:
        paper = raw.branch(Options(Preset.PAPER)).through(pipeline, _POSE)
        for method in map(ImageMethod, methods):
            runs[str(method)] = paper.branch(Options(Preset.PAPER, method)).through(pipeline, rest)
    return runs
