"""Where networks run, with an onnxruntime that offers CUDA, starts it, or only says so."""

import sys
from types import SimpleNamespace

import numpy as np
import onnx
import onnxruntime
import pytest

from builders_onnx import doubling_onnx
from shipshape import providers
from shipshape.errors import BundleError, SettingsError
from shipshape.onnx_model import OnnxModel
from shipshape.providers import Provider, Runtime, find_provider

CPU, CUDA = "CPUExecutionProvider", "CUDAExecutionProvider"


class FakeRuntime:
    """The part of onnxruntime that is asked for CUDA; without a card it starts sessions elsewhere, silently."""

    def __init__(self, offered: bool, starts: list[str] | Exception) -> None:
        self._offered, self._starts = offered, starts
        self.severities: list[int] = []

    def get_available_providers(self) -> list[str]:
        return [CUDA, CPU] if self._offered else [CPU]

    def preload_dlls(self) -> None:
        print("Failed to load libcublas")

    def set_default_logger_severity(self, severity: int) -> None:
        self.severities.append(severity)

    def InferenceSession(self, *args: object, **options: object) -> SimpleNamespace:
        if isinstance(self._starts, Exception):
            raise self._starts
        return SimpleNamespace(get_providers=lambda: self._starts)


def installed(monkeypatch: pytest.MonkeyPatch, runtime: FakeRuntime) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", runtime)
    monkeypatch.setattr(providers, "distributions", lambda name: ["a distribution"])


WITHOUT = FakeRuntime(False, [CPU])
WITH = FakeRuntime(True, [CUDA, CPU])
SILENT = FakeRuntime(True, [CPU])
BROKEN = FakeRuntime(True, RuntimeError("CUDA failure 35: driver\nis too old"))


@pytest.mark.parametrize(
    ("wanted", "runtime", "found"),
    [
        ("cpu", WITH, Provider.CPU),
        ("auto", WITH, Provider.CUDA),
        ("cuda", WITH, Provider.CUDA),
        ("auto", WITHOUT, Provider.CPU),
        ("auto", SILENT, Provider.CPU),
        ("auto", BROKEN, Provider.CPU),
    ],
)
def test_a_card_is_used_where_it_is_wanted_and_works(monkeypatch, capsys, wanted, runtime, found):
    installed(monkeypatch, runtime)
    assert find_provider(wanted) is found
    assert capsys.readouterr() == ("", ""), "stdout may be somebody's JSON"
    assert runtime.severities[1::2] == [2] * (len(runtime.severities) // 2), "others log as before"


@pytest.mark.parametrize(
    ("runtime", "cause"),
    [
        (WITHOUT, "an onnxruntime without CUDA"),
        (SILENT, "an onnxruntime that finds no usable GPU, driver, CUDA or cuDNN"),
        (BROKEN, "CUDA failure 35: driver is too old"),
    ],
)
def test_without_a_card_that_works_cuda_stops_the_start(monkeypatch, runtime, cause):
    installed(monkeypatch, runtime)
    with pytest.raises(SettingsError) as caught:
        find_provider("cuda")
    assert str(caught.value) == f"expected CUDA to work, got {cause}; docs/gpu.md says what it needs"


@pytest.mark.parametrize(("runtime", "told"), [(WITHOUT, False), (SILENT, True), (BROKEN, True)])
def test_a_card_that_does_not_work_is_told(monkeypatch, caplog, runtime, told):
    installed(monkeypatch, runtime)
    find_provider("auto")
    assert ("networks run on the processor" in caplog.text) is told


def test_a_network_that_was_put_elsewhere_is_refused(monkeypatch):
    monkeypatch.setattr(onnxruntime, "InferenceSession", SILENT.InferenceSession)
    with pytest.raises(BundleError, match=f"expected prior.onnx to run on {CUDA}, got {CPU}"):
        OnnxModel(doubling_onnx(), label="prior.onnx", runtime=Runtime(Provider.CUDA))


def test_what_is_started_to_find_out_is_a_network():
    model = onnx.load_from_string(providers._IDENTITY)
    onnx.checker.check_model(model)
    x = np.float32([7.0])
    np.testing.assert_array_equal(OnnxModel(providers._IDENTITY).run(x=x)[0], x)


@pytest.mark.skipif(CUDA not in onnxruntime.get_available_providers(), reason="onnxruntime has no CUDA")
def test_the_real_runtime_finds_a_card_or_says_why_not():
    if find_provider("auto") is Provider.CUDA:
        x = np.ones((5, 3), np.float32)
        model = OnnxModel(doubling_onnx(), runtime=Runtime(Provider.CUDA, "on"))
        np.testing.assert_array_equal(model.run(x=x)[0], 2 * x)
    else:
        with pytest.raises(SettingsError, match="expected CUDA to work"):
            find_provider("cuda")
