"""What the settings say of the device and of threads."""

import pytest

from shipshape.errors import SettingsError
from shipshape.executor import usable_cores
from shipshape.providers import Provider, Runtime
from shipshape.serving import compute
from shipshape.settings import Settings, load_settings


@pytest.mark.parametrize(
    ("workers", "provider", "threads"),
    [(0, Provider.CPU, usable_cores()), (0, Provider.CUDA, 64), (3, Provider.CPU, 3), (5, Provider.CUDA, 5)],
)
def test_a_card_has_the_threads_of_two_runs(workers, provider, threads):
    assert compute.workers_of(Settings(workers=workers), provider) == threads


@pytest.mark.parametrize("wanted", ["auto", "cpu"])
@pytest.mark.parametrize("micro_batches", ["auto", "on", "off"])
def test_the_settings_are_those_of_the_networks(monkeypatch, wanted, micro_batches):
    monkeypatch.setattr(compute, "find_provider", {"auto": Provider.CUDA, "cpu": Provider.CPU}.get)
    settings = Settings(provider=wanted, micro_batches=micro_batches)
    assert compute.runtime_of(settings) == Runtime(compute.find_provider(wanted), micro_batches)


@pytest.mark.parametrize(("name", "value"), [("provider", "tpu"), ("micro_batches", "yes")])
def test_other_words_stop_the_start(monkeypatch, name, value):
    monkeypatch.setenv(f"SHIPSHAPE_{name.upper()}", value)
    with pytest.raises(SettingsError, match=f"another value of SHIPSHAPE_{name.upper()}, got '{value}'"):
        load_settings()
