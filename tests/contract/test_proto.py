import itertools
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from shipshape.serving.encoding import Limits, Wishes, pack, points_from_bytes
from shipshape.serving.grpc.convert import to_contact, to_wishes
from shipshape.types import ImageMethod, Options, Preset
from shipshape.v1 import shipshape_pb2 as pb

ROOT = Path(__file__).parents[2]
PROTO = ROOT / "proto/shipshape/v1/shipshape.proto"
STUBS = [
    f"shipshape/{name}{end}"
    for name in ("v1/shipshape", "inference/open_inference")
    for end in ("_pb2.py", "_pb2.pyi", "_pb2_grpc.py")
]
POINTS = arrays(np.float32, st.tuples(st.integers(0, 50), st.just(3)), elements=st.floats(width=32))


def test_the_stubs_are_those_of_the_proto(tmp_path):
    pytest.importorskip("grpc_tools", reason="the stubs can only be compared where grpcio-tools is installed")
    subprocess.run(["sh", ROOT / "proto/generate.sh", tmp_path], check=True, env={"PYTHON": sys.executable})
    for name in STUBS:
        fresh = (tmp_path / name).read_text()
        assert fresh == (ROOT / "service" / name).read_text(), f"run proto/generate.sh: {name}"


@settings(deadline=None)  # a busy machine is no failure
@given(points=POINTS)
def test_packed_points_survive_the_wire(points):
    contact = pb.Contact.FromString(pb.Contact(points=pack(points)).SerializeToString())
    assert np.array_equal(points_from_bytes(contact.points, Limits()), points, equal_nan=True)


@settings(deadline=None)  # a busy machine is no failure
@given(
    contact_id=st.text(max_size=256),
    height=st.none() | st.floats(0.5, 100),
    own=st.none() | st.floats(-720, 720),
)
def test_what_stands_beside_the_points_survives_the_wire(contact_id, height, own):
    message = pb.Contact(contact_id=contact_id, sensor_height_m=height, own_true_heading_deg=own)
    contact = to_contact(pb.Contact.FromString(message.SerializeToString()), Limits())
    assert (contact.contact_id, contact.sensor_height, contact.own_true_heading_deg) == (contact_id, height, own)


def test_nothing_said_means_the_defaults():
    assert to_wishes(pb.Options()) == Wishes()


@pytest.mark.parametrize("method", list(ImageMethod))
@pytest.mark.parametrize("preset", list(Preset))
def test_every_method_can_be_said(preset, method):
    message = pb.Options(preset=f"PRESET_{preset.name}", image_method=f"IMAGE_METHOD_{method.name}")
    assert to_wishes(message).options == Options(preset, method)


def test_every_field_of_the_contract_says_what_it_means():
    lines = PROTO.read_text(encoding="utf-8").splitlines()
    messages = lines[lines.index("// One vessel to recognise.") :]
    field = re.compile(r"^\s+(?:optional |repeated )?[\w.<>, ]+ (\w+) = \d+;")
    silent = [
        match[1]
        for before, line in itertools.pairwise(messages)
        if (match := field.match(line)) and not before.strip().startswith("//")
    ]
    assert silent == []
