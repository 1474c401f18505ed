"""A real bundle beside another, each with worker processes of its own: compared, promoted under load, unloaded."""

import gc
import os
import re
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace

import psutil
import pytest

from serving.bundles import WIDER, copy_bundle, fill_with_nan, write_wider_bundle
from serving.fakes import running, until
from serving.processes import MODELS
from shipshape.bundle import load_bundle
from shipshape.bundle_writer import write_manifest
from shipshape.errors import BundleError, Conflict
from shipshape.executor import ProcessCrew
from shipshape.sample import sample_contact
from shipshape.serving import shadow
from shipshape.serving.remote_model import RemoteModel
from shipshape.serving.shadow_metrics import Verdict
from shipshape.v1 import shipshape_pb2 as pb

pytestmark = pytest.mark.skipif(
    not (MODELS / "manifest.toml").is_file(), reason="models/ has no manifest.toml yet"
)
SAMPLE = sample_contact()
CLIENTS, WORKERS = 4, 2
SAME, DIFFERS, FAILED, DROPPED = Verdict


def load(folder):
    return RemoteModel(folder, 65_536, "warning")


@pytest.fixture(scope="module")
def doors():
    """A service with the shipped bundle, of whose contacts all are compared."""
    with running(opened=False, load=load, bundle=MODELS, workers=WORKERS, shadow_share=1.0) as doors:
        doors.service.open(load(MODELS))
        yield doors


@pytest.fixture(autouse=True)
def models(doors):
    """Without a shadow afterwards, and with the shipped bundle."""
    yield doors.service.models
    doors.service.models.end_shadow()
    doors.service.models.swap(MODELS)


@pytest.fixture(scope="module")
def wider(tmp_path_factory):
    return write_wider_bundle(tmp_path_factory.mktemp("bundles") / "wider")


@pytest.fixture(scope="module")
def renamed(tmp_path_factory):
    """The shipped bundle, with other names for its classes."""
    folder = copy_bundle(tmp_path_factory.mktemp("bundles") / "renamed")
    before = load_bundle(MODELS)
    write_manifest(
        folder,
        name="renamed",
        training=before.training,
        catalogue=[replace(vessel, name=f"other {vessel.name}") for vessel in before.catalogue],
        models={model: folder / f"{model}.onnx" for model in before.models},
        parameters=before.parameters,
        scores=before.scores,
    )
    return folder


def ask(doors, index=0):
    """Digest and heading_std of one answer, through one door or the other."""
    fields = {"contact_id": str(index), "sensor_height_m": SAMPLE.sensor_height}
    if index % 2:
        found = doors.ask_grpc(SAMPLE.points_level, pb.Options(), **fields)[0].recognition
        assert found.contact_id == fields["contact_id"]
        return found.bundle, found.heading_std
    response = doors.ask_rest(SAMPLE.points_level, **fields)
    assert response.status_code == 200, response.text
    assert response.json()["contact_id"] == fields["contact_id"]
    return response.json()["bundle"], response.json()["heading_std"]


def compared(models, verdict, count):
    until(lambda: models.comparing.counts()[verdict] >= count)


def processes_of(model):
    """Its workers, once they are there."""
    until(lambda: model._crew.whole)
    return [psutil.Process(hand.process_id) for hand in model._crew.hands]


def gone(process):
    try:
        return process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def moved(doors):
    """Probability that lay elsewhere, over all comparisons."""
    found = re.search(r"^shipshape_shadow_probability_sum (\S+)$", doors.rest.get("/metrics").text, re.M)
    return float(found[1])


def test_a_bundle_of_the_same_networks_says_the_same(doors, models, wider):
    before = moved(doors)
    digest = models.cast_shadow(wider).model.bundle.digest
    for index in range(4):
        assert ask(doors, index)[0] == models.running.model.bundle.digest != digest
    compared(models, SAME, 4)
    counts = models.comparing.counts()
    assert counts[DIFFERS] == counts[FAILED] == 0
    text = doors.rest.get("/metrics").text
    assert f'shipshape_shadow_info{{digest="{digest}",name="wider"}} 1.0' in text
    assert moved(doors) - before == 0


def test_a_bundle_with_other_classes_differs(doors, models, renamed):
    models.cast_shadow(renamed)
    for index in range(3):
        ask(doors, index)
    compared(models, DIFFERS, 3)
    assert models.comparing.counts()[SAME] == 0


def test_a_bad_bundle_is_no_shadow(doors, models, wider, tmp_path):
    folder = copy_bundle(tmp_path / "bad")
    fill_with_nan(folder / "points.onnx")
    kept = models.cast_shadow(wider)
    with pytest.raises(BundleError, match=r"^expected [^\n]+, got[^\n]+$"):
        models.cast_shadow(folder)
    assert models.shadow is kept
    ask(doors)
    compared(models, SAME, 1)


def keep_asking(doors, index, enough):
    answers = []
    while not enough.is_set():
        answers.append(ask(doors, index))
    return answers


def test_promoted_under_load_without_a_dropped_or_mixed_answer(doors, models, wider):
    first, std = ask(doors)
    enough = threading.Event()
    with ThreadPoolExecutor(CLIENTS) as pool:
        asking = [pool.submit(keep_asking, doors, index, enough) for index in range(CLIENTS)]
        for _ in range(2):
            second = models.cast_shadow(wider).model.bundle.digest
            assert models.promote().model.bundle.digest == models.running.model.bundle.digest == second
            assert models.previous.model.bundle.digest == first
            assert models.rollback().model.bundle.digest == first
        models.rollback()
        enough.set()
        answers = [answer for each in asking for answer in each.result()]
    stds = {first: std, second: WIDER * std}
    assert {digest for digest, _ in answers} == stds.keys(), "both answered"
    for digest, told in answers:
        assert told == pytest.approx(stds[digest], rel=1e-5)
    counts = doors.service.executor.counts()
    assert (counts.failed, counts.refused, counts.cancelled) == (0, 0, 0)
    assert doors.service.health.ready
    assert doors.service.executor.sound


def test_its_processes_end_with_it_at_once(doors, models, wider):
    workers = processes_of(models.cast_shadow(wider).model)
    assert len(workers) == WORKERS
    for index in range(4):
        ask(doors, index)
    compared(models, SAME, 4)
    models.end_shadow()
    until(lambda: all(gone(worker) for worker in workers))
    assert doors.service.executor.sound
    ask(doors)


def test_the_old_bundle_stays_for_a_rollback_and_the_promoted_one_has_the_workers(doors, models, wider):
    before = processes_of(models.running.model)
    workers = processes_of(models.cast_shadow(wider).model)
    models.promote()
    ask(doors)
    assert not any(gone(worker) for worker in before + workers)
    os.kill(workers[0].pid, signal.SIGKILL)
    until(lambda: workers[0] not in processes_of(models.running.model))
    until(lambda: doors.service.executor.sound)
    assert ask(doors)[0] == models.running.model.bundle.digest


def test_a_shadow_whose_workers_are_stuck_or_die_harms_nobody(doors, models, wider, monkeypatch):
    monkeypatch.setattr(shadow, "PATIENCE_S", 0.1)
    workers = processes_of(models.cast_shadow(wider).model)
    for worker in workers:
        worker.suspend()
    ask(doors)
    compared(models, DROPPED, 1)
    assert doors.service.executor.sound
    for worker in workers:
        worker.kill()
    until(lambda: all(gone(worker) for worker in workers))
    until(lambda: doors.service.health.ready)
    assert doors.service.executor.sound
    monkeypatch.undo()
    processes_of(models.shadow.model)
    ask(doors)
    compared(models, SAME, 1)
    counts = doors.service.executor.counts()
    assert (counts.failed, counts.refused, counts.pending) == (0, 0, 0)


def test_stuck_workers_end_with_the_shadow_too(doors, models, wider, monkeypatch):
    """And wait for no collection: an error of theirs must not keep the model."""
    monkeypatch.setattr(shadow, "PATIENCE_S", 0.1)
    workers = processes_of(models.cast_shadow(wider).model)
    for worker in workers:
        worker.suspend()
    gc.disable()
    try:
        ask(doors)
        compared(models, DROPPED, 1)
        models.end_shadow()
        for worker in workers:
            with suppress(psutil.NoSuchProcess):
                worker.resume()  # those that had no work only have to look up
        until(lambda: all(gone(worker) for worker in workers))
    finally:
        gc.enable()


def test_a_shadow_without_its_workers_is_not_promoted(doors, models, wider, monkeypatch):
    kept = models.cast_shadow(wider)
    with monkeypatch.context() as lacking:
        lacking.setattr(ProcessCrew, "whole", False)
        with pytest.raises(Conflict, match="expected a shadow with all its workers, got one that lacks some"):
            models.promote()
    assert models.shadow is kept
    assert models.promote() is kept
    assert ask(doors)[0] == kept.model.bundle.digest
