import datetime
import errno
import socket
import ssl
import warnings

import grpc
import httpx
import pytest
import trustme
from cryptography.hazmat.primitives import serialization

from serving.certificates import (
    DOORS,
    HOST,
    OK,
    REFUSED,
    Files,
    rest_client,
    through_grpc,
    through_rest,
    tls_context,
)
from serving.fakes import PATIENCE, cluster, request, running
from shipshape.errors import SettingsError
from shipshape.serving import reloading
from shipshape.serving.tls import Tls, TlsFiles
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

AUTHORITY, STRANGER = trustme.CA(), trustme.CA()
BOAT = AUTHORITY.issue_cert("boat-7.example", common_name="boat-7")
NAMELESS = AUTHORITY.issue_cert("boat-9.example")  # no common name, an alternative one alone
FOREIGN = STRANGER.issue_cert("boat-7.example", common_name="boat-7")
A_DAY = datetime.timedelta(days=1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("certificates")


@pytest.fixture(scope="module")
def tls(folder):
    """A service that shows a certificate and asks for none."""
    with running(**Files(folder).write(AUTHORITY).settings(mutual=False)) as doors:
        yield doors.addresses


@pytest.fixture(scope="module")
def mutual(folder, tls):
    """A service that asks its clients for certificates."""
    with running(**Files(folder).settings(mutual=True)) as doors:
        yield doors.addresses


@pytest.fixture
def files(tmp_path):
    return Files(tmp_path).write(AUTHORITY)


@pytest.mark.parametrize("door", DOORS)
def test_anybody_may_connect_who_trusts_the_certificate(tls, door):
    assert DOORS[door](tls, AUTHORITY) == OK
    assert DOORS[door](tls, STRANGER) == REFUSED


@pytest.mark.parametrize("door", DOORS)
def test_a_client_must_show_a_certificate_of_the_right_authority(mutual, door):
    assert DOORS[door](mutual, AUTHORITY, BOAT) == OK
    assert DOORS[door](mutual, AUTHORITY, FOREIGN) == REFUSED
    assert DOORS[door](mutual, AUTHORITY) == REFUSED


@pytest.mark.parametrize("door", DOORS)
def test_an_expired_client_certificate_is_refused(mutual, door):
    now = datetime.datetime.now(datetime.UTC)
    expired = AUTHORITY.issue_cert("boat-7.example", not_before=now - 3 * A_DAY, not_after=now - A_DAY)
    assert DOORS[door](mutual, AUTHORITY, expired) == REFUSED


def test_a_plain_client_is_refused(tls):
    with (
        httpx.Client(base_url=f"http://{HOST}:{tls.rest_port}", timeout=PATIENCE, trust_env=False) as client,
        pytest.raises(httpx.TransportError),
    ):
        client.get("/livez")
    with grpc.insecure_channel(f"{HOST}:{tls.grpc_port}") as channel:
        call = ShipshapeStub(channel).Recognise.future(request(cluster()), timeout=PATIENCE)
        assert call.code() is grpc.StatusCode.UNAVAILABLE


@pytest.mark.parametrize("port", ["rest_port", "grpc_port"])
def test_nothing_older_than_tls_1_2(tls, port):
    def version(newest):
        context = tls_context(AUTHORITY)
        context.set_ciphers("ALL:@SECLEVEL=0")  # else the client itself would not speak it
        context.set_alpn_protocols(["h2"])  # without which gRPC takes nobody
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            context.minimum_version = ssl.TLSVersion.TLSv1
            context.maximum_version = newest
        with (
            socket.create_connection((HOST, getattr(tls, port)), PATIENCE) as connection,
            context.wrap_socket(connection, server_hostname=HOST) as secured,
        ):
            return secured.version()

    assert version(ssl.TLSVersion.TLSv1_3) == "TLSv1.3"
    assert version(ssl.TLSVersion.TLSv1_2) == "TLSv1.2"
    with pytest.raises(ssl.SSLError):
        version(ssl.TLSVersion.TLSv1_1)


@pytest.mark.parametrize("door", DOORS)
def test_new_files_hold_for_new_connections(files, monkeypatch, door):
    monkeypatch.setattr(reloading, "LOOK_S", 0.0)
    ask = DOORS[door]
    with running(**files.settings(mutual=True)) as doors:
        assert ask(doors.addresses, AUTHORITY, BOAT) == OK
        files.write(STRANGER, client_authority=AUTHORITY)
        assert ask(doors.addresses, STRANGER, BOAT) == OK
        assert ask(doors.addresses, AUTHORITY, BOAT) == REFUSED
        assert ask(doors.addresses, STRANGER, FOREIGN) == REFUSED
        files.write(STRANGER)
        assert ask(doors.addresses, STRANGER, FOREIGN) == OK
        assert ask(doors.addresses, STRANGER, BOAT) == REFUSED


def test_no_client_takes_up_a_session_that_its_certificate_began(mutual):
    context = tls_context(AUTHORITY, BOAT)

    def session(before):
        """The session of a connection that got an answer, after which a ticket would have come."""
        with (
            socket.create_connection((HOST, mutual.rest_port), PATIENCE) as connection,
            context.wrap_socket(connection, server_hostname=HOST, session=before) as secured,
        ):
            secured.sendall(b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n")
            assert secured.recv(100).startswith(b"HTTP/1.1 200 ")
            assert not secured.session_reused
            return secured.session

    session(session(None))


def test_a_connection_outlives_the_files_it_began_with(files, monkeypatch):
    monkeypatch.setattr(reloading, "LOOK_S", 0.0)
    with (
        running(**files.settings(mutual=False)) as doors,
        rest_client(doors.addresses, tls_context(AUTHORITY)) as client,
    ):
        assert client.get("/readyz").status_code == 200
        files.write(STRANGER)
        assert through_rest(doors.addresses, STRANGER) == OK
        assert client.get("/readyz").status_code == 200


@pytest.mark.parametrize("door", DOORS)
def test_new_files_that_are_broken_change_nothing(files, monkeypatch, caplog, door):
    monkeypatch.setattr(reloading, "LOOK_S", 0.0)
    with running(**files.settings(mutual=False)) as doors:
        files.key.write_bytes(STRANGER.issue_cert(HOST).private_key_pem.bytes())
        assert DOORS[door](doors.addresses, AUTHORITY) == OK
        assert "key values mismatch" in caplog.text
        files.write(STRANGER)
        assert DOORS[door](doors.addresses, STRANGER) == OK


def refusal(files, *, mutual=False):
    with pytest.raises(SettingsError) as caught:
        Tls(TlsFiles(files.certificate, files.key, files.client_ca if mutual else None))
    assert caught.value.__cause__ is None or "PRIVATE" not in str(caught.value)
    return str(caught.value).replace(f"{files.folder}/", "")


def issued(**times):
    now = datetime.datetime.now(datetime.UTC)
    return AUTHORITY.issue_cert(HOST, **{name: now + shift for name, shift in times.items()})


def test_a_certificate_out_of_date_stops_the_start(files):
    expected = "expected a server's valid certificate in certificate.pem and its key in key.pem, got: "
    files.write(AUTHORITY, issued(not_before=-2 * A_DAY, not_after=-A_DAY))
    assert refusal(files) == expected + "certificate has expired"
    files.write(AUTHORITY, issued(not_before=A_DAY, not_after=2 * A_DAY))
    assert refusal(files) == expected + "certificate is not yet valid"


def test_files_that_do_not_belong_together_stop_the_start(files):
    files.key.write_bytes(BOAT.private_key_pem.bytes())
    assert refusal(files).endswith("got: key values mismatch")


def test_an_encrypted_key_stops_the_start_without_asking_for_a_password(files):
    key = serialization.load_pem_private_key(files.key.read_bytes(), None)
    pem, pkcs8 = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    files.key.write_bytes(key.private_bytes(pem, pkcs8, serialization.BestAvailableEncryption(b"secret")))
    assert refusal(files).startswith(
        "expected a server's valid certificate in certificate.pem and its key in key.pem"
    )


@pytest.mark.parametrize("name", ["certificate", "key", "client_ca"])
@pytest.mark.parametrize("content", [b"", b"no PEM", None])
def test_a_file_that_is_none_stops_the_start(files, name, content):
    path = getattr(files, name)
    if content is None:
        path.unlink()
        assert refusal(files, mutual=True) == f"expected a PEM file at {path.name}, got: No such file or directory"
    else:
        path.write_bytes(content)
        assert f"in {path.name}" in refusal(files, mutual=True)


def test_a_file_that_is_moved_away_while_it_is_read_is_told_too(files, monkeypatch):
    def gone(*_, **__):
        raise FileNotFoundError(errno.ENOENT, "No such file or directory")

    for name in ("load_verify_locations", "load_cert_chain"):
        monkeypatch.setattr(ssl.SSLContext, name, gone)
        assert refusal(files, mutual=True).endswith("got: No such file or directory")


def test_a_client_ca_that_can_vouch_for_nobody_stops_the_start(files):
    files.client_ca.write_bytes(BOAT.cert_chain_pems[0].bytes())
    assert refusal(files, mutual=True) == "expected certificates of authorities in client_ca.pem, got none"


def test_the_name_in_a_certificate_is_the_same_client_through_both_doors(files):
    limits = {"client_contacts_per_s": 1e-6, "client_burst": 2, "max_contacts": 1}
    with running(**files.settings(mutual=True), **limits) as doors:
        for client in (BOAT, NAMELESS):
            assert through_rest(doors.addresses, AUTHORITY, client) == OK
            assert through_grpc(doors.addresses, AUTHORITY, client) == OK
            assert through_rest(doors.addresses, AUTHORITY, client) == 429
            assert through_grpc(doors.addresses, AUTHORITY, client) is grpc.StatusCode.RESOURCE_EXHAUSTED
