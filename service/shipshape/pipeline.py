"""The data path: one line a stage, the same stage code for both presets.

    pipeline = Pipeline(load_bundle(path))
    recognition = pipeline.run(contact)

The staged executor takes the steps one by one instead: `begin`, the stages of one rung of the `ladder`, `finish`.

rung                 what it leaves out                                  preset
full                 nothing                                             both
without_restoration  projection to spd2: class from the looks alone      best
heading_and_box      also the second aligned look                        best
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from shipshape import frames, sight
from shipshape.best import BestMethod
from shipshape.bundle import UNKNOWN, Bundle, check_fit
from shipshape.paper import PaperMethod
from shipshape.reasons import measure, reasons_of
from shipshape.stages import keypoints, spd2
from shipshape.stages.keypoints import KeypointParams
from shipshape.types import Box, Contact, ImagePair, Options, Preset, Recognition, Rung
from shipshape.validation import ContactLimits, check_contact
from shipshape.work import Work


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)  # the executor learns the cost of each object
class Stage:
    """One named step of the pipeline; it reads and fills the fields of the work it is given."""

    name: str
    run: Callable[[Work], None]


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class RungStages:
    """The stages of one rung, in order."""

    name: Rung
    stages: tuple[Stage, ...]


Method = PaperMethod | BestMethod


class Pipeline:
    """Cluster in, recognised and restored vessel out. Stateless and safe to share between threads.

    Raises:
        BundleError: the bundle's catalogue, networks and parameters do not belong together.
    """

    def __init__(self, bundle: Bundle, limits: ContactLimits | None = None) -> None:
        check_fit(bundle)
        self.bundle = bundle
        self.limits = limits or ContactLimits()
        paper, best = PaperMethod(bundle), BestMethod(bundle)
        methods: dict[Preset, Method] = {Preset.PAPER: paper, Preset.BEST: best}
        self._names = [vessel.name for vessel in bundle.catalogue]
        self._common = bundle.parameters["common"]
        self._thresholds = bundle.parameters.get("reasons", {})
        radius = self._common["spd2_radius"]
        self.stages = _stages(lambda work: methods[work.options.preset], radius)
        ladders = {
            Preset.PAPER: (RungStages(Rung.FULL, _stages(lambda work: paper, radius)),),
            Preset.BEST: _ladder(best, _stages(lambda work: best, radius)),
        }
        self._ladders = {
            (preset, lowest): tuple(rung for rung in ladder if Options(lowest_rung=lowest).accepts(rung.name))
            for preset, ladder in ladders.items()
            for lowest in Rung
        }

    def run(self, contact: Contact, options: Options | None = None) -> Recognition:
        """Recognise one contact.

        Raises:
            InvalidInput: the contact cannot be one vessel's cluster (see `validation.check_contact`).
        """
        work = self.begin(contact, options or Options())
        stage_ms = {}
        for stage in self.stages:
            started = time.perf_counter()
            stage.run(work)
            stage_ms[stage.name] = (time.perf_counter() - started) * 1e3
        return self.finish(work, stage_ms)

    def begin(self, contact: Contact, options: Options) -> Work:
        """Check the contact and lay it along the line of sight.

        Raises:
            InvalidInput: the contact cannot be one vessel's cluster.
        """
        # Doors hand in views of received bytes, read-only and strided: kernels would be compiled for each kind.
        contact = replace(contact, points_level=np.require(contact.points_level, np.float32, ["C", "W"]))
        check_contact(contact, self.limits)
        frame = sight.sight_frame(contact)
        return Work(contact, options, frame, sight.to_sight(contact.points_level, frame))

    def ladder(self, options: Options) -> tuple[RungStages, ...]:
        """The rungs a contact may be computed on, the best first, down to the lowest that the caller accepts."""
        return self._ladders[options.preset, options.lowest_rung]

    def finish(
        self, work: Work, stage_ms: Mapping[str, float], rung: Rung = Rung.FULL, rung_reason: str = ""
    ) -> Recognition:
        """The answer, once every stage of its rung has run."""
        if rung is not Rung.FULL:
            work.leave_unrestored()
        best = int(np.argmax(work.probabilities[:-1]))
        own = work.contact.own_true_heading_deg
        pose = work.pose
        unknown = self._is_unknown(work)
        return Recognition(
            vessel=self._names[best],
            probability=float(work.probabilities[best]),
            probabilities=dict(zip([*self._names, UNKNOWN], map(float, work.probabilities), strict=True)),
            unknown=unknown,
            reasons=reasons_of(
                measure(work, restored=rung is Rung.FULL), unknown=unknown, thresholds=self._thresholds
            ),
            heading=pose.heading,
            heading_std=work.heading_std,
            bow_probability=work.bow_probability,
            aspect_deg=frames.aspect_deg(pose.heading, pose.origin_level),
            true_heading_deg=None if own is None else frames.true_heading_deg(pose.heading, own),
            box=_box(work),
            restored=work.restored,
            images=ImagePair(work.before, work.after) if rung is Rung.FULL else None,
            keypoints_level=pose.to_level(work.keypoints_vessel),
            rung=rung,
            rung_reason=rung_reason,
            preset=work.options.preset,
            image_method=work.options.image_method if work.options.preset is Preset.PAPER else None,
            bundle=self.bundle.digest,
            stage_ms=dict(stage_ms),
            descriptors=spd2.to_grey(work.images),
        )

    def _is_unknown(self, work: Work) -> bool:
        *known, unknown = work.probabilities
        return bool(unknown > min(max(known), self._common["unknown_above"]))


def _stages(method: Callable[[Work], Method], spd2_radius: float) -> tuple[Stage, ...]:
    """They do not hold the pipeline: a circle would keep a swapped-out bundle until the next collection."""
    return (
        Stage("prior", lambda work: method(work).prior(work)),
        Stage("heading", lambda work: method(work).heading(work)),
        Stage("bow_stern", lambda work: method(work).bow_stern(work)),
        Stage("projection", lambda work: method(work).projection(work)),
        Stage("inpainting", lambda work: method(work).inpainting(work)),
        Stage("lifting", lambda work: method(work).lifting(work)),
        Stage("keypoints", _keypoints),
        Stage("spd2", lambda work: _spd2(work, spd2_radius)),
        Stage("classification", lambda work: method(work).classification(work)),
    )


def _keypoints(work: Work) -> None:
    work.points_vessel = work.pose.to_vessel(work.restored.points_level)
    work.keypoints_vessel = keypoints.select_keypoints(work.points_vessel, KeypointParams())


def _spd2(work: Work, radius: float) -> None:
    work.images = spd2.describe(work.points_vessel, work.keypoints_vessel, radius)


def _ladder(best: BestMethod, full: tuple[Stage, ...]) -> tuple[RungStages, ...]:
    """Each rung begins as far as it can with the stages of the one above: work can change over half-way."""
    prior, heading, bow_stern = full[:3]
    look, classification = Stage("heading", best.heading_in_one_look), Stage("classification", best.classify_looks)
    return (
        RungStages(Rung.FULL, full),
        RungStages(Rung.WITHOUT_RESTORATION, (prior, heading, bow_stern, classification)),
        RungStages(Rung.HEADING_AND_BOX, (prior, look, bow_stern, classification)),
    )


def _box(work: Work) -> Box:
    x, y, water = work.pose.origin_level
    return Box((x, y, water + work.pose.size.height / 2), work.pose.size)
