"""Contacts -> a running service over gRPC, in the batch lane, as often as it is too busy -> their answers."""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from urllib.parse import urlsplit

import grpc
import numpy as np

from shipshape.batch.recognition import Answer, AnswerAll
from shipshape.errors import FileError, SettingsError, ShipshapeError
from shipshape.types import (
    Box,
    Contact,
    ImageMethod,
    Options,
    Preset,
    Reason,
    Recognition,
    ReferenceBox,
    RestoredCloud,
    Rung,
)
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

CONTACTS = 32  # of a message: few enough to leave room for the lanes before
TIMEOUT_S, PATIENCE_S, PAUSE_S = 60.0, 600.0, 0.2
PUSHBACK = "grpc-retry-pushback-ms"
POINT_BYTES = 12
ADVICE = "split a scan into clusters first"
BUSY = (pb.ERROR_KIND_OVERLOADED, pb.ERROR_KIND_DEADLINE_EXCEEDED, pb.ERROR_KIND_NOT_READY)
BUSY_CODES = (
    grpc.StatusCode.RESOURCE_EXHAUSTED,
    grpc.StatusCode.UNAVAILABLE,
    grpc.StatusCode.DEADLINE_EXCEEDED,
)


class Service:
    """A connection to a service, which may be used from many threads.

    Args:
        url: grpc://HOST:PORT, or grpcs:// for TLS.
        ca: PEM file of who signed its certificate; None: those that gRPC trusts.
        token: Bearer token, or nothing.
        sleep: Waits so many seconds.

    Raises:
        SettingsError: No service of shipshape.v1 answers there.
        FileError: The PEM file cannot be read.
    """

    def __init__(
        self, url: str, ca: Path | None = None, token: str = "", sleep: Callable[[float], None] = time.sleep
    ) -> None:
        parts = urlsplit(url)
        if parts.scheme not in ("grpc", "grpcs") or ":" not in parts.netloc:
            raise SettingsError(f"expected --service like grpc://127.0.0.1:50051, got {url!r:.80}")
        channel = _channel(parts.netloc, secure=parts.scheme == "grpcs", ca=ca)
        self._stub = ShipshapeStub(channel)  # type: ignore[no-untyped-call]
        self._metadata = [("authorization", f"Bearer {token}")] if token else []
        self._sleep = sleep
        try:
            info = self._stub.GetModelInfo(pb.GetModelInfoRequest(), timeout=TIMEOUT_S, metadata=self._metadata)
        except grpc.RpcError as error:
            raise SettingsError(f"expected shipshape.v1 at {url}, got {error.code().name}") from error
        self.version: str = info.version
        self.bundle: str = info.bundle
        self._contacts = min(CONTACTS, info.limits.max_contacts)
        self._bytes: int = info.limits.max_body_bytes // 2
        self._points: int = info.limits.max_points

    def answers_of(self, options: Options, *, restored: bool) -> AnswerAll:
        """Its answers, always in full and by the bundle that it had at first."""
        wishes = pb.Options(
            preset=f"PRESET_{options.preset.upper()}",
            image_method=f"IMAGE_METHOD_{options.image_method.upper()}",
            bundle=self.bundle,
            include_restored=restored,
            lane=pb.LANE_BATCH,
            lowest_rung=pb.RUNG_FULL,
        )

        def answers(contacts: Sequence[Contact]) -> Iterator[Answer]:
            """A message after the other."""
            for group in self._groups(contacts):
                yield from self._ask(group, wishes)

        return answers

    def _groups(self, contacts: Sequence[Contact]) -> Iterator[list[pb.Contact]]:
        group: list[pb.Contact] = []
        size = 0
        for contact in contacts:
            message = _to_message(contact)
            if group and (len(group) == self._contacts or size + len(message.points) > self._bytes):
                yield group
                group, size = [], 0
            group.append(message)
            size += len(message.points)
        if group:
            yield group

    def _ask(self, group: list[pb.Contact], wishes: pb.Options) -> list[Answer]:
        """The answers to a group; what the service is too busy for is asked again."""
        # What is over the limit of a message is not sent: it would be refused with all others in it.
        answers: dict[int, Answer] = {
            index: f"expected at most {self._points} points in a cluster, got {points}: {ADVICE}"
            for index, message in enumerate(group)
            if (points := len(message.points) // POINT_BYTES) > self._points
        }
        until = time.monotonic() + PATIENCE_S
        while len(answers) < len(group):
            open_ = [index for index in range(len(group)) if index not in answers]
            pause = self._send(group, open_, wishes, answers)
            if len(answers) == len(group):
                break
            if time.monotonic() > until:
                raise ShipshapeError(
                    f"expected the service to take batch work within {PATIENCE_S:g} s, got refusals alone: run "
                    "the same command again when it is less busy, it goes on where it was stopped"
                )
            self._sleep(pause)
        return [answers[index] for index in range(len(group))]

    def _send(
        self, group: list[pb.Contact], open_: list[int], wishes: pb.Options, answers: dict[int, Answer]
    ) -> float:
        """Ask for the answers that are still open, and fill them in; seconds to wait before the rest."""
        request = pb.RecogniseScanRequest(contacts=[group[index] for index in open_], options=wishes)
        try:
            response = self._stub.RecogniseScan(request, timeout=TIMEOUT_S, metadata=self._metadata)
        except grpc.RpcError as error:
            if error.code() not in BUSY_CODES:
                raise ShipshapeError(f"expected answers of the service, got {_words(error)}") from error
            return _pushback(error)
        for index, result in zip(open_, response.results, strict=True):
            if result.HasField("recognition"):
                answers[index] = to_recognition(result.recognition)
            elif result.error.kind not in BUSY:
                answers[index] = result.error.message
        return PAUSE_S


def to_recognition(message: pb.Recognition) -> Recognition:
    """The recognition in a message, without images."""
    size, center, restored = message.box, message.box.center, message.restored
    points = np.frombuffer(restored.points, "<f4").astype(np.float32).reshape(-1, 3)
    measured = np.frombuffer(restored.measured, np.uint8).astype(bool)
    if not message.HasField("restored"):  # only how many there are is known
        measured = np.arange(message.measured_points + message.inferred_points) < message.measured_points
        points = np.zeros((len(measured), 3), np.float32)
    keypoints = [(point.x, point.y, point.z) for point in message.keypoints]
    return Recognition(
        vessel=message.vessel,
        probability=message.probability,
        probabilities={entry.name: entry.probability for entry in message.probabilities},
        unknown=message.unknown,
        reasons=tuple(Reason(_plain(pb.Reason.Name(reason), "REASON_")) for reason in message.reasons),
        heading=message.heading,
        heading_std=message.heading_std,
        bow_probability=message.bow_probability,
        aspect_deg=message.aspect_deg,
        true_heading_deg=message.true_heading_deg if message.HasField("true_heading_deg") else None,
        box=Box((center.x, center.y, center.z), ReferenceBox(size.length, size.beam, size.height)),
        restored=RestoredCloud(points, measured),
        images=None,
        keypoints_level=np.array(keypoints, np.float32).reshape(-1, 3),
        rung=Rung(message.rung),
        rung_reason=message.rung_reason,
        preset=Preset(_plain(pb.Preset.Name(message.preset), "PRESET_")),
        image_method=_image_method(message.image_method),
        bundle=message.bundle,
        stage_ms={stage.stage: stage.milliseconds for stage in message.stages},
    )


def _image_method(value: pb.ImageMethod) -> ImageMethod | None:
    name = _plain(pb.ImageMethod.Name(value), "IMAGE_METHOD_")
    return None if name == "unspecified" else ImageMethod(name)


def _plain(name: str, prefix: str) -> str:
    return name.removeprefix(prefix).lower()


def _to_message(contact: Contact) -> pb.Contact:
    return pb.Contact(
        contact_id=contact.contact_id[:256],
        points=contact.points_level.astype("<f4").tobytes(),
        sensor_height_m=contact.sensor_height,
        own_true_heading_deg=contact.own_true_heading_deg,
    )


def _channel(host: str, *, secure: bool, ca: Path | None) -> grpc.Channel:
    options = [("grpc.enable_http_proxy", 0), ("grpc.max_receive_message_length", -1)]
    if not secure:
        return grpc.insecure_channel(host, options)
    try:
        return grpc.secure_channel(host, grpc.ssl_channel_credentials(ca.read_bytes() if ca else None), options)
    except OSError as error:
        raise FileError(f"expected a PEM file in --ca, got: {error}") from error


def _pushback(error: grpc.RpcError) -> float:
    told = [entry.value for entry in error.trailing_metadata() or () if entry.key == PUSHBACK]
    return float(told[0]) / 1e3 if told else PAUSE_S


def _words(error: grpc.RpcError) -> str:
    return f"{error.code().name}: {error.details()}"
