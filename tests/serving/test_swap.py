"""The bundle is swapped and rolled back under load: no answer is dropped, and none mixes two bundles."""

import gc
import resource
import shutil
import subprocess
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor

import pytest

from serving.bundles import WIDER, copy_bundle, fill_with_nan, load_model, rewritten, write_wider_bundle
from serving.fakes import PATIENCE, FakePipeline, cluster, fake_model, request, running
from serving.processes import MODELS
from shipshape.errors import BundleError, Cancelled, Conflict
from shipshape.sample import sample_contact
from shipshape.v1 import shipshape_pb2 as pb

pytestmark = pytest.mark.skipif(
    not (MODELS / "manifest.toml").is_file(), reason="models/ has no manifest.toml yet"
)
SAMPLE = sample_contact()
CLIENTS = 4  # two a door


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    return write_wider_bundle(tmp_path_factory.mktemp("bundles") / "wider")


@pytest.fixture(scope="module")
def doors():
    """A service with the shipped bundle."""
    with running(opened=False, load=load_model, bundle=MODELS, workers=2) as doors:
        doors.service.open(load_model(MODELS))
        yield doors


@pytest.fixture(autouse=True)
def _with_the_shipped_bundle(doors):
    yield
    doors.service.models.swap(MODELS)


def answer_of(doors, index, bundle=""):
    """Digest and heading_std of one answer, through one door or the other."""
    fields = {"contact_id": str(index), "sensor_height_m": SAMPLE.sensor_height}
    if index % 2:
        options = pb.Options(bundle=bundle)
        found = doors.ask_grpc(SAMPLE.points_level, options, **fields)[0].recognition
        assert found.contact_id == fields["contact_id"]
        return found.bundle, found.heading_std
    response = doors.ask_rest(SAMPLE.points_level, bundle=bundle, **fields)
    assert response.status_code == 200, response.text
    assert response.json()["contact_id"] == fields["contact_id"]
    return response.json()["bundle"], response.json()["heading_std"]


def keep_asking(doors, index, enough):
    answers = []
    while not enough.is_set():
        answers.append(answer_of(doors, index))
    return answers


def running_digest(doors):
    by_rest = doors.rest.get("/v1/model").json()["bundle"]
    assert doors.stub.GetModelInfo(pb.GetModelInfoRequest(), timeout=PATIENCE).bundle == by_rest
    return by_rest


def test_no_answer_is_dropped_or_mixed_under_load(doors, other):
    models, enough = doors.service.models, threading.Event()
    stds = {}
    for folder in (MODELS, other):
        models.swap(folder)
        digest, std = answer_of(doors, 0)
        assert digest == running_digest(doors)
        stds[digest] = std
    first, second = stds.values()
    assert second == pytest.approx(WIDER * first)
    with ThreadPoolExecutor(CLIENTS) as pool:
        asking = [pool.submit(keep_asking, doors, index, enough) for index in range(CLIENTS)]
        for _ in range(3):
            models.swap(MODELS)
            models.swap(other)
            models.rollback()
        enough.set()
        answers = [answer for each in asking for answer in each.result()]
    assert {digest for digest, _ in answers} == stds.keys(), "both answered"
    for digest, std in answers:
        assert std == pytest.approx(stds[digest], rel=1e-5)
    assert doors.service.executor.counts().failed == 0


def test_a_request_keeps_the_bundle_it_began_with():
    second = FakePipeline()
    with running(load=lambda folder: fake_model(second, digest="cd" * 32)) as doors:
        held = doors.stub.Recognise.future(request(cluster(), contact_id="hold"), timeout=PATIENCE)
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        doors.service.models.swap(MODELS)
        queued = doors.stub.Recognise.future(request(cluster(), contact_id="after"), timeout=PATIENCE)
        doors.pipeline.release.set()
        assert held.result().recognition.contact_id == "hold"
        assert queued.result().recognition.contact_id == "after"
        assert doors.pipeline.computed[-1] == "hold"
        assert second.computed[-1] == "after"


def test_the_bundle_insisted_on_is_the_one_that_answers(doors, other):
    models = doors.service.models
    assert answer_of(doors, 0, bundle="default")[0] == answer_of(doors, 1, bundle="default")[0]
    digest = models.swap(other).model.bundle.digest
    for index in range(2):
        assert answer_of(doors, index, bundle="wider")[0] == answer_of(doors, index, bundle=digest)[0] == digest
    refused = doors.ask_rest(SAMPLE.points_level, bundle="default")
    assert (refused.status_code, refused.json()["detail"]) == (
        400,
        f"expected bundle wider ({digest}), got default",
    )


def test_rollback_goes_back_and_forth(doors, other):
    models = doors.service.models
    before = running_digest(doors)
    after = models.swap(other).model.bundle.digest
    assert running_digest(doors) == after
    assert models.rollback().model.bundle.digest == running_digest(doors) == before
    assert models.rollback().model.bundle.digest == running_digest(doors) == after
    assert f'digest="{after}",name="wider"' in doors.rest.get("/metrics").text


def test_swapping_to_the_running_bundle_changes_nothing(doors, other):
    models = doors.service.models
    models.swap(other)
    kept, running_now = models.previous, models.running
    assert models.swap(other) is running_now
    assert models.previous is kept


def test_there_is_nothing_to_roll_back_to_at_first():
    with running() as doors, pytest.raises(Conflict, match="expected a bundle to roll back to, got"):
        doors.service.models.rollback()


def flip_a_byte(folder):
    content = bytearray((folder / "points.onnx").read_bytes())
    content[len(content) // 2] ^= 1
    (folder / "points.onnx").write_bytes(content)


def cut_a_network_out(folder):
    text = (folder / "manifest.toml").read_text()
    (folder / "manifest.toml").write_text(text.replace("[models.points", "[models.dots"))


def put_another_shape(folder):
    shutil.copy(folder / "inpainting.onnx", folder / "aligned.onnx")
    rewritten(folder, name="other shape")


def answer_nan(folder):
    fill_with_nan(folder / "points.onnx")


def forget_a_parameter(folder):
    text = (folder / "manifest.toml").read_text()
    (folder / "manifest.toml").write_text(text.replace("heading_std_scale", "heading_std_scales"))


def fill_the_disk(folder):
    """What `cp` leaves when it cannot write on: here it is stopped at half a megabyte of each file."""
    shutil.rmtree(folder)
    command = 'trap "" XFSZ; ulimit -f 1024; cp -r "$0" "$1"'
    copied = subprocess.run(["sh", "-c", command, MODELS, folder], check=False, capture_output=True)
    assert copied.returncode != 0, "the disk was not full"


def take_all_away(folder):
    shutil.rmtree(folder)


@pytest.mark.parametrize(
    "damage",
    [
        flip_a_byte,
        cut_a_network_out,
        put_another_shape,
        answer_nan,
        forget_a_parameter,
        fill_the_disk,
        take_all_away,
    ],
)
def test_a_bad_bundle_leaves_the_old_one_serving(doors, damage, tmp_path):
    folder = copy_bundle(tmp_path / "bad")
    damage(folder)
    before = (doors.service.models.running, doors.service.models.previous, answer_of(doors, 0))
    with pytest.raises(BundleError, match=r"^expected [^\n]+, got[^\n]+$"):
        doors.service.models.swap(folder)
    assert (doors.service.models.running, doors.service.models.previous, answer_of(doors, 1)) == before
    assert doors.service.health.ready


def test_one_change_at_a_time():
    entered, release = threading.Event(), threading.Event()

    def load(folder):
        entered.set()
        assert release.wait(PATIENCE)
        raise BundleError("expected a bundle, got none")

    with running(load=load) as doors, ThreadPoolExecutor(1) as pool:
        first = pool.submit(doors.service.models.swap, MODELS)
        assert entered.wait(PATIENCE)
        for change in (lambda: doors.service.models.swap(MODELS), doors.service.models.rollback):
            with pytest.raises(Conflict, match="expected one change of the bundle at a time"):
                change()
        assert doors.ask_rest(cluster()).status_code == 200, "requests do not wait for it"
        release.set()
        assert isinstance(first.exception(PATIENCE), BundleError)


def test_a_stop_ends_a_swap():
    entered, left = threading.Event(), threading.Event()

    def load(folder):
        entered.set()
        assert left.wait(PATIENCE)
        return load_model(folder)

    with running(load=load) as doors, ThreadPoolExecutor(1) as pool:
        swapping = pool.submit(doors.service.models.swap, MODELS)
        assert entered.wait(PATIENCE)
        doors.service.leave()
        left.set()
        assert isinstance(swapping.exception(PATIENCE), Cancelled)


def test_fifty_swaps_leave_neither_threads_nor_memory_behind(doors, other):
    def swap_there_and_back():
        doors.service.models.swap(other)
        doors.service.models.swap(MODELS)

    for _ in range(5):
        swap_there_and_back()
    threads, before = threading.active_count(), resident_mb()
    for _ in range(20):
        swap_there_and_back()
    assert threading.active_count() <= threads
    assert resident_mb() - before < 200, "40 bundles would be one gigabyte"


def test_a_bundle_that_was_swapped_out_is_freed_at_once(doors, other):
    models, freed = doors.service.models, threading.Event()
    gc.disable()  # collections come when they come: nothing may wait for them
    try:
        models.swap(other)
        weakref.finalize(models.running.model.pipeline, freed.set)
        models.swap(MODELS)
        assert not freed.is_set(), "it is kept for a rollback"
        models.swap(other)
        models.swap(MODELS)
        assert freed.is_set()
    finally:
        gc.enable()


def resident_mb():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20
