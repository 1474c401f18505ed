"""The batch lane of a running service gives the rows that this machine would compute itself."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from oip.real import MODELS, real
from serving.fakes import cluster, running
from shipshape.batch.service import PAUSE_S, Service
from shipshape.cli import main
from shipshape.client import Endpoint, Lane, Refusal, Rung
from shipshape.errors import NotReady, Overloaded, SettingsError, ShipshapeError, TooLarge
from shipshape.types import Contact, Options
from shipshape.validation import ContactLimits, check_contact

__all__ = ["real"]

SCAN = Path(__file__).parents[2] / "examples" / "contacts.npz"


def url_of(doors) -> str:
    return f"grpc://127.0.0.1:{doors.addresses.grpc_port}"


def endpoint_of(doors) -> Endpoint:
    return Endpoint(url_of(doors))


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
        answers = Service(endpoint_of(doors)).answers_of(Options(), restored=False)
        first, second, third = answers([Contact(cluster()), Contact(cluster(3)), Contact(cluster(), "crash")])
    assert first.vessel == "tug"
    assert (first.measured_points, first.inferred_points) == (40, 40)
    assert second == "expected at least 10 points in a cluster, got 3"
    assert "id" in third


class Busy:
    """A client whose service is busy at first, and then for the second contact alone."""

    def __init__(self, answer):
        self.answer, self.calls = answer, []

    def scan(self, contacts, wishes):
        self.calls.append((len(contacts), wishes.lane, wishes.lowest_rung))
        if len(self.calls) == 1:
            raise NotReady("expected a ready service, got one that is not")
        results = [self.answer] * len(contacts)
        if len(self.calls) == 2:
            results[1] = Refusal("", Overloaded("expected room, got none"))
        return results


def test_it_waits_for_a_busy_service_and_asks_again():
    slept = []
    with running() as doors:
        service = Service(endpoint_of(doors), sleep=slept.append)
        (answer,) = service.answers_of(Options(), restored=False)([Contact(cluster())])
        service._client = busy = Busy(answer)
        answers = list(service.answers_of(Options(), restored=False)([Contact(cluster())] * 3))
    assert [answer.vessel for answer in answers] == ["tug"] * 3
    assert busy.calls == [(count, Lane.BATCH, Rung.FULL) for count in (3, 3, 1)]
    assert slept == [PAUSE_S, PAUSE_S]


def test_it_does_not_wait_for_ever(monkeypatch):
    monkeypatch.setattr("shipshape.batch.service.PATIENCE_S", 0.0)
    with running() as doors:
        service = Service(endpoint_of(doors), sleep=lambda seconds: None)
        service._client = Busy(None)
        with pytest.raises(ShipshapeError, match="expected the service to take batch work within 0 s, got"):
            list(service.answers_of(Options(), restored=False)([Contact(cluster())]))


def test_messages_hold_no_more_than_the_service_takes():
    with running(max_contacts=2) as doors:
        service = Service(endpoint_of(doors))
        groups = list(service._groups([Contact(cluster())] * 5))
    assert [len(group) for group in groups] == [2, 2, 1]


@pytest.mark.parametrize("points", [100_000, 1_400_000, 2_000_000])  # over the limits of a contact, body, message
def test_a_contact_that_is_too_large_is_refused_alone(points):
    asked = []
    with running() as doors:
        service = Service(endpoint_of(doors), sleep=asked.append)
        large = Contact(np.ones((points, 3), np.float32))
        answers = list(service.answers_of(Options(), restored=False)([Contact(cluster()), large]))
    assert answers[0].vessel == "tug"
    with pytest.raises(TooLarge) as here:
        check_contact(large, ContactLimits())
    assert answers[1] == str(here.value)  # as this machine says it
    assert not asked


def test_another_bundle_than_at_first_ends_the_run():
    with running() as doors:
        service = Service(endpoint_of(doors))
        service.bundle = "0" * 64
        with pytest.raises(ShipshapeError, match=r"expected answers of the service, got: .*bun"):
            list(service.answers_of(Options(), restored=False)([Contact(cluster())]))


def test_nobody_there_is_told():
    with pytest.raises(
        SettingsError, match=r"expected shipshape\.v1 at grpc://127\.0\.0\.1:1, got: expected a ser"
    ):
        Service(Endpoint("grpc://127.0.0.1:1"))


def test_ids_that_a_service_would_not_take_are_cut():
    with running() as doors:
        answers = Service(endpoint_of(doors)).answers_of(Options(), restored=False)
        (answer,) = answers([Contact(cluster(), "x" * 300)])
    assert answer.contact_id == "x" * 256
