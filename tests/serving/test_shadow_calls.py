"""An operator's calls around a shadow bundle: loaded, refused, replaced, promoted, unloaded."""

import gc
import json
import threading
import weakref

import httpx
import pytest

from serving.fakes import DIGEST, PATIENCE, FakePipeline, fake_model
from serving.shadowed import OTHER, TOKEN, administered, compared, service, shared
from shipshape.cli import main
from shipshape.errors import Cancelled, Conflict

__all__ = ["service", "shared"]


def test_a_bad_one_is_refused_and_changes_nothing(service):
    service.call("shadow", folder="second")
    for folder, kind in (("bad", "bundle_refused"), ("odd", "bundle_refused"), ("../..", "invalid_input")):
        answer = service.admin.post("/admin/shadow", json={"folder": folder})
        assert answer.json()["error"] == kind
    status = service.call("status")
    assert (status["shadow"]["name"], status["bundle"]["digest"]) == ("second", DIGEST)
    service.ask()
    compared(service, differs=1)


def test_another_one_takes_its_place_and_counts_anew(service):
    service.call("shadow", folder="second")
    service.ask(2)
    compared(service, differs=2)
    assert service.call("shadow", folder="turned")["shadow"]["name"] == "turned"
    service.ask()
    compared(service, same=1)


def test_without_a_shadow_nothing_is_watched(service):
    core = service.doors.service._core
    assert core._watch is None
    service.call("shadow", folder="second")
    assert core._watch is not None
    assert service.call("unshadow")["shadow"] is None
    assert core._watch is None
    assert not any(name == "shipshape_shadow_info" for name, *_ in service.metrics())
    assert service.call("unshadow")["shadow"] is None, "it may be repeated"


def test_a_shadow_that_was_unloaded_is_freed_at_once(service):
    freed = threading.Event()
    gc.disable()  # collections come when they come: nothing may wait for them
    try:
        service.call("shadow", folder="second")
        # What only the model knows: the fake pipeline knows itself.
        weakref.finalize(service.doors.service.models.shadow.model.render, freed.set)
        service.ask(2)
        compared(service, differs=2)
        service.call("unshadow")
        assert freed.wait(PATIENCE)
    finally:
        gc.enable()


def test_promote_and_roll_back(service):
    service.call("shadow", folder="second")
    status = service.call("promote")
    try:
        assert (status["bundle"]["name"], status["previous"]["digest"], status["shadow"]) == (
            "second",
            DIGEST,
            None,
        )
        assert service.doors.rest.get("/v1/model").json()["bundle"] == OTHER
        refused = service.admin.post("/admin/promote")
        assert (refused.status_code, refused.json()["error"]) == (409, "conflict")
    finally:
        assert service.call("rollback")["bundle"]["digest"] == DIGEST


def test_promoting_the_running_bundle_changes_nothing(service):
    before = service.call("shadow", folder="same")
    after = service.call("promote")
    assert (after["bundle"], after["previous"]) == (before["bundle"], before["previous"])
    assert after["shadow"] is None


def test_one_change_at_a_time(service):
    models = service.doors.service.models
    with models._alone():
        for change in (lambda: models.cast_shadow("second"), models.end_shadow, models.promote):
            with pytest.raises(Conflict, match="expected one change of the bundle at a time"):
                change()


def test_no_call_without_the_token(service):
    for path in ("shadow", "unshadow", "promote"):
        url = f"{service.admin.base_url}/admin/{path}"
        answer = httpx.post(url, json={"folder": "second"}, trust_env=False)
        assert (answer.status_code, answer.json()["error"]) == (401, "unauthenticated")
        assert service.doors.rest.post(f"/admin/{path}", headers=service.admin.headers).status_code == 404
    contract = service.admin.get("/openapi.json")
    assert {"/admin/shadow", "/admin/unshadow", "/admin/promote"} <= contract.json()["paths"].keys()


def test_a_stop_ends_the_shadow(tmp_path):
    with administered(tmp_path) as service:
        service.call("shadow", folder="hold")
        service.ask()
        assert service.loaded["hold"].halted.acquire(timeout=PATIENCE)
        comparing = service.doors.service.models.comparing
        service.loaded["hold"].proceed.set()
        service.doors.service.stop()
        assert comparing._run is None
        with pytest.raises(Cancelled):
            comparing.begin(fake_model(FakePipeline()), apart=True)


def test_the_command_line(service, tmp_path, capsys):
    token = tmp_path / "admin.token"
    token.write_text(f"{TOKEN}\n")

    def call(*words):
        return main(["admin", *words, "--url", str(service.admin.base_url), "--token-file", str(token)])

    assert call("shadow", "second") == 0
    assert json.loads(capsys.readouterr().out)["shadow"]["name"] == "second"
    assert call("unshadow") == 0
    assert json.loads(capsys.readouterr().out)["shadow"] is None
    assert call("promote") == 1
    assert capsys.readouterr().err == (
        "shipshape: expected a shadow to promote, got a service that has none: load it with shadow\n"
    )
    for words in (["shadow"], ["unshadow"], ["promote"]):
        with pytest.raises(SystemExit) as ended:
            main(["admin", *words, "--help"])
        assert ended.value.code == 0
        assert f"example:\n  shipshape admin {words[0]}" in capsys.readouterr().out
