"""The client against the service itself: answers are those of the door, behind tokens and certificates too."""

import subprocess
import sys
import threading
from pathlib import Path

import grpc
import numpy as np
import pytest
import trustme

from client.scripted import PATIENCE, Scripted, gone, of_any_shape, serving
from serving.certificates import Files
from serving.fakes import PNG, cluster, running
from shipshape.client import LAN, SATELLITE, Client, Contact, Endpoint, Link, Rung, Wishes
from shipshape.client.answers import Answer, Refusal
from shipshape.client.calls import Calls
from shipshape.client.failures import KINDS, error_of_contact
from shipshape.client.messages import from_contact
from shipshape.errors import (
    DeadlineExceeded,
    FileError,
    InvalidInput,
    ServiceFault,
    SettingsError,
    Unauthenticated,
    Unprocessable,
    Unreachable,
)
from shipshape.quantised import dequantise, quantise
from shipshape.sample import sample_contact
from shipshape.serving.faults import FaultKind
from shipshape.serving.grpc import server
from shipshape.serving.grpc.server import PING_INTERVAL_MS
from shipshape.serving.tokens import fresh_token, hash_of
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

CONTACT = Contact(cluster(), "c1", 3.0, 370.0)
ALL = Wishes(restored=True, images=True, png=True)
MODELS = Path(__file__).parents[2] / "models"
needs_models = pytest.mark.skipif(
    not (MODELS / "manifest.toml").is_file(), reason="models/ has no manifest.toml yet"
)

HEAVY = """
import sys
import shipshape.client
heavy = {"numba", "onnxruntime", "cv2", "fastapi", "pydantic", "uvicorn", "orjson", "prometheus_client"}
print(sorted(heavy & set(sys.modules)))
"""


def url_of(doors, scheme="grpc"):
    return f"{scheme}://127.0.0.1:{doors.addresses.grpc_port}"


def test_importing_the_client_loads_nothing_that_computes_or_serves():
    ran = subprocess.run([sys.executable, "-c", HEAVY], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"


def test_an_answer_is_the_message_with_types(doors):
    with Client(url_of(doors), timeout_s=PATIENCE) as client:
        answer = client.recognise(CONTACT, ALL)
    message = doors.ask_grpc(
        CONTACT.points_level,
        contact_id="c1",
        sensor_height_m=3.0,
        own_true_heading_deg=370.0,
        options=pb.Options(include_restored=True),
    )[0].recognition
    for name in ("contact_id", "vessel", "probability", "unknown", "heading", "heading_std", "bow_probability"):
        assert getattr(answer, name) == getattr(message, name), name
    assert answer.true_heading_deg == message.true_heading_deg == 10
    assert (answer.box.center_level, answer.box.size.length) == ((40.0, 1.5, -2.0), 20.0)
    assert answer.probabilities == {"tug": 0.75, "rhib": 0.125, "unknown": 0.125}
    assert [*answer.reasons] == ["few_points", "end_on"]
    assert (answer.rung, answer.preset, answer.image_method) == (Rung.FULL, "best", None)
    assert (answer.measured_points, answer.inferred_points) == (40, 40)
    assert answer.restored.points_level.tobytes() == message.restored.points
    assert answer.restored.measured.sum() == 40
    assert np.array_equal(answer.images.after, 255 - answer.images.before)
    assert answer.png == PNG
    assert np.array_equal(answer.keypoints_level, CONTACT.points_level[:3])
    assert [*answer.stage_ms] == ["prior", "heading"]
    assert answer.endpoint == url_of(doors)


@pytest.mark.parametrize("link", [LAN, SATELLITE])
def test_points_of_another_shape_are_refused_before_they_pass_for_other_points(doors, link):
    with_intensity = np.ones((300, 4), np.float32)  # its bytes would be those of 400 points
    with (
        Client(Endpoint(url_of(doors), link), timeout_s=PATIENCE) as client,
        pytest.raises(InvalidInput, match=r"expected points of shape \(n, 3\), got \(300, 4\)"),
    ):
        client.recognise(of_any_shape(with_intensity))


def test_a_client_that_cannot_be_opened_leaves_no_connection(tmp_path, monkeypatch):
    closed = []

    async def close(calls):
        closed.append(calls.endpoint.url)

    monkeypatch.setattr(Calls, "close", close)
    locked = Endpoint("grpcs://127.0.0.1:1", ca=tmp_path / "none.pem")
    with pytest.raises(FileError), Client("grpc://127.0.0.1:1", locked):
        pytest.fail("it was opened")
    assert closed == ["grpc://127.0.0.1:1"]


def test_a_scan_keeps_its_order_and_its_errors(doors):
    with Client(url_of(doors), timeout_s=PATIENCE) as client:
        good, bad = client.scan([CONTACT, Contact(cluster(3), "few")])
    assert isinstance(good, Answer)
    assert isinstance(bad, Refusal)
    assert (good.restored, good.images, good.png) == (None, None, None)
    assert (bad.contact_id, type(bad.error)) == ("few", Unprocessable)


def test_a_satellite_link_sends_int16_and_gets_the_answer_to_that(doors):
    with Client(Endpoint(url_of(doors), SATELLITE), timeout_s=PATIENCE) as client:
        answer = client.recognise(CONTACT, ALL)
        refused = client.scan([Contact(np.full((12, 3), np.nan, np.float32))])
    sent = dequantise(quantise(CONTACT.points_level, 0.01))
    assert np.array_equal(answer.restored.points_level[:40], sent)
    assert 0 < np.abs(sent - CONTACT.points_level).max() <= 0.00501
    assert isinstance(refused[0].error, Unprocessable)
    plain, small = (from_contact(CONTACT, step_m).ByteSize() for step_m in (None, 0.01))
    assert small < 0.7 * plain


def test_what_each_endpoint_runs_and_takes_is_told(doors):
    here, gone = f"grpc://127.0.0.1:{doors.addresses.grpc_port}", "grpc://127.0.0.1:1"
    with Client(here, gone) as client:
        told = client.info()
    limits = doors.stub.GetModelInfo(pb.GetModelInfoRequest()).limits
    assert told[here].bundle_name == doors.stub.GetModelInfo(pb.GetModelInfoRequest()).bundle_name
    assert (told[here].max_points, told[here].max_contacts) == (limits.max_points, limits.max_contacts)
    assert isinstance(told[gone], Unreachable)


def test_capacity_and_status_are_told_by_endpoint(doors):
    nobody = gone()
    with Client(url_of(doors), nobody) as client:
        told = client.capacity()
        first, second = client.probe()
    assert told[url_of(doors)].workers == 1
    assert [*told[url_of(doors)].promises] == [Rung.FULL, Rung.HEADING_AND_BOX]
    assert isinstance(told[nobody], Unreachable)
    assert (first.resting, second.resting) == (False, True)
    assert first.failure is None
    assert isinstance(second.failure, Unreachable)
    assert first.round_trip_s > 0
    assert first.expected_s > first.round_trip_s
    assert second.expected_s is None


def test_a_client_certificate_and_a_token_from_files(tmp_path):
    authority, token = trustme.CA(), fresh_token()
    files = Files(tmp_path).write(authority)
    shown = authority.issue_cert("fleet.example")
    ours = {"ca": tmp_path / "ca.pem", "certificate": tmp_path / "own.pem", "key": tmp_path / "own.key"}
    ours["ca"].write_bytes(authority.cert_pem.bytes())
    ours["certificate"].write_bytes(b"".join(blob.bytes() for blob in shown.cert_chain_pems))
    ours["key"].write_bytes(shown.private_key_pem.bytes())
    (tmp_path / "tokens").write_text(f"fleet {hash_of(token)}\n")
    file = tmp_path / "token"
    file.write_text(token + "\n")
    with running(**files.settings(mutual=True), tokens_file=tmp_path / "tokens") as doors:
        url = url_of(doors, "grpcs")
        with Client(Endpoint(url, **ours, token_file=file), timeout_s=PATIENCE) as client:
            assert client.recognise(CONTACT).vessel == "tug"
            file.write_text("another")  # holds at the next call
            with pytest.raises(Unauthenticated):
                client.recognise(CONTACT)
        with Client(Endpoint(url, **ours), timeout_s=PATIENCE) as client, pytest.raises(Unauthenticated):
            client.recognise(CONTACT)
        without = Endpoint(url, ca=ours["ca"], token_file=file)
        with Client(without, timeout_s=1.0) as client, pytest.raises(Unreachable):
            client.recognise(CONTACT)


@pytest.mark.parametrize("name", ["ca", "token_file"])
def test_files_that_are_not_there(name, tmp_path):
    endpoint = Endpoint("grpcs://127.0.0.1:1", **{name: tmp_path / "gone"})
    with (
        pytest.raises(FileError, match=r"gone, got: No such file"),
        Client(endpoint) as client,
    ):
        client.recognise(CONTACT)


@pytest.mark.parametrize(
    ("url", "more"),
    [
        ("127.0.0.1:50051", {}),
        ("http://127.0.0.1:50051", {}),
        ("grpc://127.0.0.1", {}),
        ("grpc://127.0.0.1:x", {}),
        ("grpc://127.0.0.1:1/x", {}),
        ("grpc://127.0.0.1:1", {"ca": Path("x")}),
        ("grpcs://127.0.0.1:1", {"key": Path("x")}),
    ],
)
def test_endpoints_that_are_none(url, more):
    with pytest.raises(SettingsError, match=r"^expected .+, got .+"):
        Endpoint(url, **more)


def test_a_client_of_nothing():
    with pytest.raises(SettingsError, match="expected an endpoint, or local=True"):
        Client()


def test_every_kind_of_error_has_its_class():
    assert set(KINDS) == set(FaultKind)
    assert set(KINDS) == {
        pb.ErrorKind.Name(n).removeprefix("ERROR_KIND_").lower() for n in pb.ErrorKind.values()[1:]
    }


def test_a_kind_of_error_that_only_a_newer_service_knows_is_a_fault_of_it():
    error = error_of_contact(pb.ContactError(kind=99, message="expected tides, got none"))
    assert isinstance(error, ServiceFault)
    assert str(error) == "expected tides, got none"


def test_the_service_takes_pings_as_often_as_links_send_them():
    for link in (LAN, SATELLITE):
        options = dict(link.channel_options())
        assert options["grpc.keepalive_time_ms"] > PING_INTERVAL_MS
        assert options["grpc.keepalive_permit_without_calls"] == 1


@pytest.mark.parametrize(("every_ms", "lost"), [(100, False), (60_000, True)])
def test_an_idle_connection_that_is_pinged_stays_unless_that_is_too_often(every_ms, lost, monkeypatch):
    """In a tenth of the time and faster: gRPC gives a connection up at the third ping that comes too early."""
    monkeypatch.setattr(server, "PING_INTERVAL_MS", every_ms)
    link = Link(keepalive_s=0.15, keepalive_timeout_s=PATIENCE, probe_s=1, first_backoff_s=1, longest_backoff_s=1)
    gone_away = threading.Event()

    def seen(state):
        if states and state is not grpc.ChannelConnectivity.READY:
            gone_away.set()
        states.extend([state] * (state is grpc.ChannelConnectivity.READY))

    states = []
    with running() as doors:
        address = f"127.0.0.1:{doors.addresses.grpc_port}"
        with grpc.insecure_channel(address, link.channel_options()) as channel:
            channel.subscribe(seen)
            ShipshapeStub(channel).GetModelInfo(pb.GetModelInfoRequest(), timeout=PATIENCE)
            assert gone_away.wait(PATIENCE if lost else 2.0) is lost
            assert states


@needs_models
def test_what_no_service_answers_is_computed_here():
    sample = np.load(MODELS.parent / "examples/contacts.npz", allow_pickle=False)
    contact = Contact(sample["points"][: sample["n"][0]], "one", float(sample["sensor_height"]))
    with serving(Scripted("shore")) as shore, Client(shore.url, local=MODELS, timeout_s=PATIENCE) as client:
        assert client.recognise(contact).vessel == "shore"
    with Client(shore.url, local=MODELS, timeout_s=PATIENCE) as client:
        answer = client.recognise(contact, ALL)
        results = client.scan([contact, Contact(contact.points_level[:3], "few")])
        (streamed,) = client.stream([[contact]])
    assert (answer.vessel, answer.endpoint, answer.contact_id) == (str(sample["vessel"][0]), "local", "one")
    assert answer.png.startswith(b"\x89PNG")
    assert answer.restored is not None
    assert [type(each) for each in results] == [Answer, Refusal]
    assert isinstance(results[1].error, Unprocessable)
    assert results[0].restored is None
    assert streamed.results[0].vessel == answer.vessel


@needs_models
def test_what_is_computed_here_has_its_deadline_too():
    many = [sample_contact()] * 256  # none takes less than a millisecond
    with Client(local=MODELS) as client:
        with pytest.raises(DeadlineExceeded, match="expected an answer of this process in time, got none"):
            client.scan(many, timeout_s=0.05)
        (streamed,) = client.stream([many], timeout_s=0.05)
        assert isinstance(streamed.error, DeadlineExceeded)
        assert client.recognise(many[0], timeout_s=PATIENCE).endpoint == "local"
