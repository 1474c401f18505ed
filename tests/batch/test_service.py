"""The batch lane of a running service gives the rows that this machine would compute itself."""

from pathlib import Path

import grpc
import numpy as np
import pyarrow.parquet as pq
import pytest

from oip.real import MODELS, real
from serving.fakes import cluster, running
from shipshape.batch.service import PAUSE_S, Service, to_recognition
from shipshape.cli import main
from shipshape.errors import SettingsError, ShipshapeError, TooLarge
from shipshape.types import Contact, Options
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.validation import ContactLimits, check_contact

__all__ = ["real"]

SCAN = Path(__file__).parents[2] / "examples" / "contacts.npz"


def url_of(doors) -> str:
    return f"grpc://127.0.0.1:{doors.addresses.grpc_port}"


def test_a_service_gives_the_same_rows(real, tmp_path):
    given = ["batch", str(SCAN), "--sensor-height", "3", "--restored"]
    assert main([*given, "--out", str(tmp_path / "asked"), "--service", url_of(real)]) == 0
    assert main([*given, "--out", str(tmp_path / "here"), "--bundle", str(MODELS), "--workers", "1"]) == 0
    asked, here = (pq.read_table(tmp_path / name / "contacts.parquet") for name in ("asked", "here"))
    assert asked.drop_columns("code").equals(here.drop_columns("code"))
    assert pq.read_table(tmp_path / "asked/clouds").equals(pq.read_table(tmp_path / "here/clouds"))
    assert asked["code"][0].as_py().endswith(" of a service")


def test_what_a_service_refuses_is_told(tmp_path):
    with running() as doors:
        answers = Service(url_of(doors)).answers_of(Options(), restored=False)
        first, second, third = answers([Contact(cluster()), Contact(cluster(3)), Contact(cluster(), "crash")])
    assert first.vessel == "tug"
    assert (first.measured_points, first.inferred_points) == (40, 40)
    assert second == "expected at least 10 points in a cluster, got 3"
    assert "id" in third


def test_it_waits_for_a_busy_service_and_asks_again():
    calls, slept = [], []

    class Busy(Exception):
        def code(self):
            return grpc.StatusCode.RESOURCE_EXHAUSTED

    class BusyError(Busy, grpc.RpcError):
        def trailing_metadata(self):
            return [_Entry("grpc-retry-pushback-ms", "250")]

    class Stub:
        """Busy at first, then busy for the second contact."""

        def RecogniseScan(self, request, timeout, metadata):
            calls.append((len(request.contacts), request.options.lane, request.options.lowest_rung))
            if len(calls) == 1:
                raise BusyError
            results = [pb.ContactResult(recognition=doors_answer) for _ in request.contacts]
            if len(calls) == 2:
                overloaded = pb.ContactError(kind=pb.ERROR_KIND_OVERLOADED, message="expected room, got none")
                results[1] = pb.ContactResult(error=overloaded)
            return pb.RecogniseScanResponse(results=results)

    with running() as doors:
        doors_answer = doors.ask_grpc(cluster())[0].recognition
        service = Service(url_of(doors), sleep=slept.append)
        service._stub = Stub()
        answers = list(service.answers_of(Options(), restored=False)([Contact(cluster())] * 3))
    assert [answer.vessel for answer in answers] == ["tug"] * 3
    assert calls == [
        (3, pb.LANE_BATCH, pb.RUNG_FULL),
        (3, pb.LANE_BATCH, pb.RUNG_FULL),
        (1, pb.LANE_BATCH, pb.RUNG_FULL),
    ]
    assert slept == [0.25, PAUSE_S]


class _Entry:
    def __init__(self, key, value):
        self.key, self.value = key, value


def test_messages_hold_no_more_than_the_service_takes():
    with running(max_contacts=2) as doors:
        service = Service(url_of(doors))
        groups = list(service._groups([Contact(cluster())] * 5))
    assert [len(group) for group in groups] == [2, 2, 1]


@pytest.mark.parametrize("points", [100_000, 1_400_000, 2_000_000])  # over the limits of a contact, body, message
def test_a_contact_that_is_too_large_is_refused_alone(points):
    asked = []
    with running() as doors:
        service = Service(url_of(doors), sleep=asked.append)
        large = Contact(np.ones((points, 3), np.float32))
        answers = list(service.answers_of(Options(), restored=False)([Contact(cluster()), large]))
    assert answers[0].vessel == "tug"
    with pytest.raises(TooLarge) as here:
        check_contact(large, ContactLimits())
    assert answers[1] == str(here.value)  # as this machine says it
    assert not asked


def test_another_bundle_than_at_first_ends_the_run():
    with running() as doors:
        service = Service(url_of(doors))
        service.bundle = "0" * 64
        with pytest.raises(ShipshapeError, match=r"expected answers of the service, got INVALID_ARGUMENT: .*bun"):
            list(service.answers_of(Options(), restored=False)([Contact(cluster())]))


def test_nobody_there_is_told():
    with pytest.raises(SettingsError, match=r"expected shipshape\.v1 at grpc://127\.0\.0\.1:1, got UNAVAILABLE"):
        Service("grpc://127.0.0.1:1")


def test_a_recognition_without_its_cloud_still_counts_its_points():
    message = pb.Recognition(
        vessel="tug", rung="full", preset=pb.PRESET_BEST, measured_points=3, inferred_points=2
    )
    said = to_recognition(message)
    assert (said.measured_points, said.inferred_points, said.image_method) == (3, 2, None)
    assert said.restored.points_level.dtype == np.float32
