"""How large the answer to a scan may be: what is foreseen bounds what comes, and too much of it is refused."""

import grpc
import numpy as np
import pytest

from oip.real import real
from oip.wire import by_binary, by_grpc_raw
from serving.fakes import PATIENCE, cluster, doors
from shipshape.sample import sample_contact
from shipshape.serving.answer_size import MOST_MIB, most_bytes
from shipshape.serving.encoding import Wishes
from shipshape.types import Contact
from shipshape.v1 import shipshape_pb2 as pb

__all__ = ["doors", "real"]

PACKED = {"Content-Type": "application/octet-stream"}
WISHES = ("restored", "images", "png")


@pytest.mark.parametrize("preset", ["best", "paper"])
@pytest.mark.parametrize("count", [60, 6000])
def test_no_answer_is_longer_than_foreseen(real, preset, count):
    random = np.random.default_rng(0)
    points = random.choice(sample_contact().points_level, count) + random.normal(0, 0.05, (count, 3))
    contact = Contact(points.astype(np.float32))
    for wished in ((), *((name,) for name in WISHES), WISHES):
        query = {"preset": preset} | {f"include_{name}": "true" for name in wished}
        content = contact.points_level.tobytes()
        answer = real.rest.post("/v1/recognise", params=query, content=content, headers=PACKED)
        assert answer.status_code == 200
        foreseen = most_bytes([contact], Wishes(**dict.fromkeys(wished, True)))
        assert len(answer.content) <= foreseen <= 10 * len(answer.content)


@pytest.mark.parametrize(
    ("contacts", "each", "wished"), [(100, 40, "png"), (69, 20_000, "restored")], ids=["pictures", "clouds"]
)
def test_a_scan_that_wishes_for_too_much_is_refused_and_less_of_it_is_not(doors, contacts, each, wished):
    content = cluster(each).tobytes()

    def scan(count, **more):
        query = {"counts": ",".join([str(each)] * count)} | more
        return doors.rest.post("/v1/scan", params=query, content=content * count, headers=PACKED)

    refused = scan(contacts, **{f"include_{wished}": "true"})
    assert (refused.status_code, refused.json()["error"]) == (413, "too_large")
    assert refused.json()["detail"].startswith(
        f"expected a scan whose answer takes at most {MOST_MIB} MiB in JSON, got one that may take "
    )
    assert scan(contacts // 4, **{f"include_{wished}": "true"}).status_code == 200
    assert scan(contacts).status_code == 200


def test_every_door_refuses_the_same_scan(doors):
    points, count = cluster(20_000), 69
    inputs = {"points": np.tile(points, (count, 1)), "counts": np.full(count, len(points), np.int32)}
    for wished in (["restored_points"], ["probability"]):
        outcomes = [infer(doors, inputs, wished).kind for infer in (by_binary, by_grpc_raw)]
        scan = pb.RecogniseScanRequest(contacts=[pb.Contact(points=points.tobytes())] * count)
        scan.options.include_restored = wished == ["restored_points"]
        try:
            doors.stub.RecogniseScan(scan, timeout=PATIENCE)
            outcomes.append("")
        except grpc.RpcError as error:
            outcomes.append(dict(error.trailing_metadata())["shipshape-error"])
        assert outcomes == (["too_large"] * 3 if scan.options.include_restored else [""] * 3)
