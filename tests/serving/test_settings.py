import os
from pathlib import Path

import pytest
from pydantic import ValidationError

from shipshape import settings
from shipshape.errors import SettingsError
from shipshape.sample import sample_contact
from shipshape.settings import Settings, load_settings


@pytest.fixture(autouse=True)
def _clean_environment(monkeypatch):
    for name in [name for name in os.environ if name.startswith("SHIPSHAPE_")]:
        monkeypatch.delenv(name)


def test_defaults_are_safe_and_work():
    effective = load_settings()
    assert effective.host == "127.0.0.1"
    assert (effective.rest_port, effective.grpc_port) == (8080, 50051)
    assert (effective.max_points, effective.max_contacts, effective.max_body_bytes) == (65536, 256, 16 * 2**20)


def test_environment_below_overrides(monkeypatch):
    monkeypatch.setenv("SHIPSHAPE_REST_PORT", "9000")
    monkeypatch.setenv("SHIPSHAPE_GRPC_PORT", "9001")
    effective = load_settings(grpc_port=0)
    assert (effective.rest_port, effective.grpc_port) == (9000, 0)


def test_an_unknown_variable_refuses_the_start(monkeypatch):
    monkeypatch.setenv("SHIPSHAPE_REST_PROT", "9000")
    with pytest.raises(
        SettingsError,
        match=r"^expected only known SHIPSHAPE_\* variables, got SHIPSHAPE_REST_PROT: did you mean \w+REST_PORT",
    ):
        load_settings()


@pytest.mark.parametrize(("name", "value"), [("rest_port", "70000"), ("budget_ms", "-1"), ("workers", "many")])
def test_a_bad_value_refuses_the_start(monkeypatch, name, value):
    monkeypatch.setenv(f"SHIPSHAPE_{name.upper()}", value)
    with pytest.raises(SettingsError, match=f"SHIPSHAPE_{name.upper()}, got '{value}'"):
        load_settings()


def test_a_scan_must_fit_the_queue():
    with pytest.raises(SettingsError) as caught:
        load_settings(queue_limit=1)
    assert str(caught.value) == (
        "expected SHIPSHAPE_QUEUE_LIMIT to hold a whole scan, SHIPSHAPE_MAX_CONTACTS = 256, got 1"
    )


def test_a_scan_must_fit_the_limits_of_a_client():
    assert load_settings(client_burst=1).client_burst == 1, "which holds with a rate alone"
    for limits in ({"client_burst": 255, "client_contacts_per_s": 10.0}, {"client_under_way": 255}):
        with pytest.raises(SettingsError) as caught:
            load_settings(**limits)
        assert str(caught.value) == (
            f"expected SHIPSHAPE_{next(iter(limits)).upper()} to hold a whole scan, "
            "SHIPSHAPE_MAX_CONTACTS = 256, got 255"
        )


@pytest.mark.parametrize("rate", ["-1", "inf", "nan"])
def test_a_rate_must_be_a_number_of_contacts(monkeypatch, rate):
    monkeypatch.setenv("SHIPSHAPE_CLIENT_CONTACTS_PER_S", rate)
    with pytest.raises(SettingsError, match=f"SHIPSHAPE_CLIENT_CONTACTS_PER_S, got '{rate}'"):
        load_settings()


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (("tls_key",), "expected both SHIPSHAPE_TLS_CERTIFICATE and SHIPSHAPE_TLS_KEY, got one of them"),
        (("tls_certificate",), "expected both SHIPSHAPE_TLS_CERTIFICATE and SHIPSHAPE_TLS_KEY, got one of them"),
        (("tls_client_ca",), "expected SHIPSHAPE_TLS_CLIENT_CA beside SHIPSHAPE_TLS_CERTIFICATE, got it alone"),
    ],
)
def test_half_of_tls_refuses_the_start(given, sentence):
    with pytest.raises(SettingsError) as caught:
        load_settings(**dict.fromkeys(given, "file.pem"))
    assert str(caught.value) == sentence


def test_the_contact_of_the_warm_up_must_pass():
    assert load_settings(max_points=len(sample_contact().points_level)).max_points == 1000
    with pytest.raises(SettingsError, match="SHIPSHAPE_MAX_POINTS, got 999"):
        load_settings(max_points=999)


def test_settings_cannot_be_changed():
    with pytest.raises(ValidationError):
        Settings().host = "0.0.0.0"


def test_every_setting_says_what_it_means():
    for name, field in Settings.model_fields.items():
        assert field.description, name


def test_the_default_bundle_is_in_the_current_directory_or_the_checkout(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert settings.default_bundle() == Path(settings.__file__).resolve().parents[2] / "models"
    (tmp_path / "models").mkdir()
    assert settings.default_bundle() == Path("models")
