import re

import pytest

from serving.test_process import START_PATIENCE, needs_models, start
from shipshape.serving.access import Access, exposures, load_access
from shipshape.settings import Settings

SOMEWHERE = {"tls_certificate": "certificate.pem", "tls_key": "key.pem"}


@pytest.fixture
def closed(tmp_path):
    """A file that is nobody else's business."""
    path = tmp_path / "closed"
    path.touch(mode=0o600)
    return path


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.8.8", "::1", "localhost"])
def test_loopback_is_closed_enough(host):
    assert exposures(Settings(host=host)) == []


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "boat.example"])
def test_an_open_address_wants_tls_and_callers_who_say_who_they_are(host, closed):
    plain, anonymous = exposures(Settings(host=host))
    where = f"on {host}, which is not loopback, got n"
    assert plain.startswith(f"expected TLS {where}one")
    assert anonymous.startswith(f"expected tokens or client certificates {where}either")
    keys = {"tls_certificate": closed, "tls_key": closed}
    assert exposures(Settings(host=host, **keys)) == [anonymous]
    assert exposures(Settings(host=host, **keys, tls_client_ca=closed)) == []
    assert exposures(Settings(host=host, **keys, tokens_file=closed)) == []
    assert exposures(Settings(host=host, tokens_file=closed)) == [plain]


@pytest.mark.parametrize("mode", [0o601, 0o602, 0o604])
@pytest.mark.parametrize("name", ["tls_key", "tokens_file"])
def test_secrets_that_others_can_open_are_told(closed, name, mode):
    closed.chmod(mode)
    other = {"tls_certificate": closed} if name == "tls_key" else {}
    variable = f"SHIPSHAPE_{name.upper()}"
    assert exposures(Settings(**{name: closed}, **other)) == [
        f"expected {variable} closed to other users, got {closed} open: chmod o= {closed}"
    ]


def test_exposures_are_logged_at_the_start(caplog):
    load_access(Settings(host="0.0.0.0"), lambda reason: None)
    assert [record.levelname for record in caplog.records] == ["WARNING", "WARNING"]


def test_nothing_is_asked_of_anybody_by_default():
    access = load_access(Settings(), lambda reason: None)
    assert (access.tls, access.tokens) == (None, None)
    assert access.holder([]) is Access().holder(["Bearer whatever"]) is None
    assert access.client([], None, "127.0.0.1") == "address 127.0.0.1"


@needs_models
def test_a_file_that_is_not_there_stops_the_process(tmp_path):
    with start("-m", "shipshape", "serve", SHIPSHAPE_TOKENS_FILE=str(tmp_path / "tokens")) as process:
        try:
            output = process.stderr.read()
            assert process.wait(START_PATIENCE) == 2
        finally:
            process.kill()
    assert re.fullmatch(r"shipshape: expected a tokens file at \S+, got: No such file or directory\n", output)
