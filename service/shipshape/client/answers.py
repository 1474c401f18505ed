"""What a client is given: frozen values, metres and radians, frames as in `shipshape.types`."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from shipshape.errors import ShipshapeError
from shipshape.types import Box, ImageMethod, ImagePair, Preset, Reason, RestoredCloud, Rung

LOCAL = "local"  # in the place of an endpoint's address: computed in this process


@dataclass(frozen=True, slots=True)
class Answer:
    """What Shipshape says of one contact, and how it came."""

    contact_id: str
    vessel: str  # the most probable vessel of the catalogue, also when `unknown` says it is none of them
    probability: float
    probabilities: Mapping[str, float]  # every catalogue vessel and "unknown"; sums to 1
    unknown: bool  # true: better treated as not in the catalogue
    reasons: tuple[Reason, ...]  # why to trust this answer less; empty: nothing speaks against it
    heading: float  # rad, counter-clockwise from ahead of the sensor's own vessel
    heading_std: float  # rad, of the heading modulo pi
    bow_probability: float  # that the bow points along `heading` and not the opposite way
    aspect_deg: float  # 0 bow-on, 90 abeam, 180 stern-on
    true_heading_deg: float | None  # clockwise from north; None unless the contact gave its own
    box: Box
    measured_points: int
    inferred_points: int
    keypoints_level: Float32[np.ndarray, "k 3"]  # m; none below rung `full`
    rung: Rung
    rung_reason: str  # why it is not `full`: a sentence; empty when it is
    preset: Preset
    image_method: ImageMethod | None  # None: the image of preset `best`
    bundle: str  # digest of the model bundle
    stage_ms: Mapping[str, float]
    restored: RestoredCloud | None  # None unless wished for
    images: ImagePair | None  # None unless wished for, and below rung `full`
    png: bytes | None  # None unless wished for
    endpoint: str  # address of the service that answered, or "local"


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why one contact of a scan got no answer."""

    contact_id: str
    error: ShipshapeError  # what `recognise` would have raised


@dataclass(frozen=True, slots=True)
class ScanAnswer:
    """What came of one scan of a stream: one result a contact, in its order, or the error of all of them."""

    sequence: int  # which scan: 0 is the first that was sent
    results: tuple[Answer | Refusal, ...]
    error: ShipshapeError | None = None


@dataclass(frozen=True, slots=True)
class Capacity:
    """What a service would promise a contact now."""

    promises: Mapping[Rung, float]  # seconds until the answer, by rung
    wait_s: float  # of every promise, until a worker is free
    load: float  # contacts that wait or are computed, a worker
    workers: int
    budget_s: float  # that an answer is meant to take
    level: str  # of the latency budget: "ok", "warn" or "error"


@dataclass(frozen=True, slots=True)
class Info:
    """What a service runs, and what it takes."""

    version: str  # of the service
    bundle: str  # digest
    bundle_name: str
    max_points: int  # of a contact
    max_contacts: int  # of a scan
    max_body_bytes: int  # of a request


@dataclass(frozen=True, slots=True)
class EndpointStatus:
    """What a client knows of one endpoint."""

    endpoint: str
    resting: bool  # it failed a moment ago and is left alone
    failure: ShipshapeError | None  # why it rests, or rested last; None: it never failed
    round_trip_s: float | None  # smoothed; None: not measured yet
    expected_s: float | None  # until the answer to a contact sent now; None: not known yet
    load: float | None  # as the service reported it last
