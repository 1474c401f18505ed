"""Real requests through both doors of a real service with the shipped bundle: real hulls, and the README's own."""

import re
import shutil
import subprocess
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import cv2
import grpc
import httpx
import numpy as np
import pytest

from shipshape.bundle import load_bundle
from shipshape.pipeline import Pipeline
from shipshape.serving.prepare import load_local
from shipshape.serving.service import Addresses, Service
from shipshape.settings import Settings
from shipshape.types import Contact
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub
from shipshape_lab.simulator.mesh_files import load_vessel
from shipshape_lab.simulator.scan import Conditions, scan_vessel
from shipshape_lab.simulator.sea import Placement
from shipshape_lab.simulator.sensor import PANDAR64

ROOT = Path(__file__).parents[2]
MESHES = ROOT.parent / "shared" / "data" / "vessels"
pytestmark = pytest.mark.skipif(
    not (ROOT / "models/manifest.toml").exists(), reason="the default bundle is not trained"
)
PATIENCE = 30.0
CASES = [
    ("oc_tugboat", "tug", Placement(45.0, heading=0.6, bearing=0.4)),
    ("bc_hurricane_rhib", "rhib", Placement(35.0, heading=-2.4, bearing=-1.2)),
]


@dataclass(frozen=True)
class Doors:
    addresses: Addresses
    rest: httpx.Client
    stub: ShipshapeStub


def _load(folder):
    return load_local(folder, 65_536)


@pytest.fixture(scope="module")
def doors():
    settings = Settings(rest_port=0, grpc_port=0, workers=1, default_timeout_ms=PATIENCE * 1e3)
    service = Service(settings, 1, load=_load, on_death=lambda: pytest.fail("a door died"))
    with ExitStack() as stack:
        stack.callback(service.stop)
        addresses = service.start()
        service.open(_load(ROOT / "models"))
        url = f"http://127.0.0.1:{addresses.rest_port}"
        rest = stack.enter_context(httpx.Client(base_url=url, timeout=PATIENCE, trust_env=False))
        channel = stack.enter_context(grpc.insecure_channel(f"127.0.0.1:{addresses.grpc_port}"))
        yield Doors(addresses, rest, ShipshapeStub(channel))


@pytest.mark.skipif(not MESHES.is_dir(), reason="shared/data/vessels is not beside the repository")
@pytest.mark.parametrize(("mesh", "kind", "placement"), CASES, ids=[mesh for mesh, *_ in CASES])
def test_a_real_hull_gets_one_answer_through_both_doors(doors, mesh, kind, placement):
    vessel = load_vessel(MESHES / f"{mesh}.ply")
    seen = scan_vessel(
        vessel, PANDAR64, placement=placement, conditions=Conditions(), rng=np.random.default_rng(0)
    )
    packed = seen.points_level.astype("<f4").tobytes()

    by_grpc = through_grpc(doors, packed, placement.sensor_height)
    by_rest = through_rest(doors, packed, placement.sensor_height)

    assert (by_grpc["vessel"], by_grpc["unknown"]) == (by_rest["vessel"], by_rest["unknown"]) == (kind, False)
    for number in ("heading", "probability", "bow_probability"):
        assert by_grpc[number] == pytest.approx(by_rest[number], abs=1e-5)
    assert abs(np.degrees(np.angle(np.exp(1j * (by_rest["heading"] - placement.heading))))) < 10.0
    assert overlap(by_rest, placement, vessel.box) > 0.7


@pytest.mark.skipif(not MESHES.is_dir(), reason="shared/data/vessels is not beside the repository")
@pytest.mark.parametrize("mesh", ["bc_hmas_armidale", "bc_hmas_brunei", "bc_hmas_huon"])
@pytest.mark.parametrize("heading", [1.2, -2.0])
def test_a_real_ship_longer_than_the_catalogue_is_unknown(mesh, heading):
    placement = Placement(80.0, heading=heading, bearing=0.1)
    seen = scan_vessel(
        load_vessel(MESHES / f"{mesh}.ply"),
        PANDAR64,
        placement=placement,
        conditions=Conditions(),
        rng=np.random.default_rng(0),
    )
    said = Pipeline(load_bundle(ROOT / "models")).run(Contact(seen.points_level))
    assert said.unknown
    assert said.probabilities["unknown"] > 0.9


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_the_requests_of_the_readme_get_their_answers(doors, tmp_path):
    (tmp_path / "examples").mkdir()
    shutil.copy(ROOT / "examples/contacts.npz", tmp_path / "examples")
    blocks = re.findall(r"^```\n(.*?)^```$", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE)
    requests = [block for block in blocks if "out/contact.f32" in block]
    told = [run_in(tmp_path, request, doors.addresses) for request in requests]
    assert len(told) == 2
    assert '"vessel":"rhib"' in told[0]
    assert 'vessel: "rhib"' in told[1]


def run_in(folder, script, addresses):
    """What `script` prints when it asks the service at `addresses` instead."""
    for shown, here in (
        (".venv/bin/python", sys.executable),
        ("127.0.0.1:8080", f"127.0.0.1:{addresses.rest_port}"),
        ("127.0.0.1:50051", f"127.0.0.1:{addresses.grpc_port}"),
        ("curl ", "curl --noproxy 127.0.0.1 "),
        ("timeout=1)", f"timeout={PATIENCE})"),
    ):
        script = script.replace(shown, here)
    done = subprocess.run(
        ["sh", "-ec", script], check=False, cwd=folder, capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def through_grpc(doors, packed, sensor_height):
    contact = pb.Contact(points=packed, sensor_height_m=sensor_height)
    said = doors.stub.Recognise(pb.RecogniseRequest(contact=contact), timeout=PATIENCE).recognition
    return {
        name: getattr(said, name) for name in ("vessel", "unknown", "heading", "probability", "bow_probability")
    }


def through_rest(doors, packed, sensor_height):
    response = doors.rest.post(
        "/v1/recognise",
        params={"sensor_height_m": sensor_height},
        content=packed,
        headers={"content-type": "application/octet-stream"},
    )
    assert response.status_code == 200, response.text
    return response.json()


def overlap(said, placement, true_box):
    """Intersection over union of the box said and the true one, from above."""
    middle = placement.range_m * np.exp(1j * placement.bearing)
    length, beam, _ = true_box
    true = (middle.real, middle.imag), (length, beam), float(np.degrees(placement.heading))
    box = said["box"]
    found = box["center"][:2], (box["length"], box["beam"]), float(np.degrees(said["heading"]))
    _, corners = cv2.rotatedRectangleIntersection(true, found)
    common = 0.0 if corners is None else cv2.contourArea(cv2.convexHull(corners))
    return common / (length * beam + box["length"] * box["beam"] - common)
