"""The systems that are compared, all run by the service's own stages on the same contact.

`best` is the shipped default; `full_top`, `full_side`, `z_top` and `z_side` are preset `paper` with each of its
image methods; `raw_spd2` is the classifier of the raw cluster, which the pipeline calls the prior.
"""

import copy
import time
from collections.abc import Iterable
from dataclasses import dataclass, field

from shipshape.pipeline import Pipeline
from shipshape.types import Contact, ImageMethod, Options, Preset
from shipshape.work import Work

BEST, RAW = "best", "raw_spd2"
IMAGE_METHODS = tuple(str(method) for method in ImageMethod)
SYSTEMS = (RAW, BEST, *IMAGE_METHODS)
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


def run_systems(pipeline: Pipeline, contact: Contact) -> dict[str, Run]:
    """Every pipeline of PIPELINES on one contact; what systems share is computed once.

    Raises:
        InvalidInput: the contact cannot be one vessel's cluster.
    """
    raw = Run(pipeline.begin(contact, Options())).through(pipeline, _PRIOR)
    rest = [stage.name for stage in pipeline.stages if stage.name not in (*_PRIOR, *_POSE)]
    runs = {BEST: raw.branch(Options(Preset.BEST)).through(pipeline, (*_POSE, *rest))}
    paper = raw.branch(Options(Preset.PAPER)).through(pipeline, _POSE)
    for method in ImageMethod:
        runs[str(method)] = paper.branch(Options(Preset.PAPER, method)).through(pipeline, rest)
    return runs
