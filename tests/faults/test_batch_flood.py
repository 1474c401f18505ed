"""A flood of batch work: a contact that a collision hangs on goes before all of it, at the next stage boundary.

By how much that moves its latency is measured by benchmarks/lane_flood.py.
"""

import grpc

from faults.live import MAX_CONTACTS, PATIENCE, POINTS, eventually, live
from serving.fakes import request
from shipshape.v1 import shipshape_pb2 as pb

BATCH, COLLISION = pb.Options(lane=pb.LANE_BATCH), pb.Options(lane=pb.LANE_COLLISION)


def flood(service, names):
    contacts = [pb.Contact(contact_id=name, points=POINTS.tobytes()) for name in names]
    scan = pb.RecogniseScanRequest(contacts=contacts, options=BATCH)
    return service.stub.RecogniseScan.future(scan, timeout=PATIENCE)


def test_a_collision_contact_overtakes_a_flood_of_batch_work(tmp_path):
    with live(tmp_path, warm=False, WORKERS="1") as service:
        first = service.stub.Recognise.future(request(POINTS, BATCH, contact_id="wedge"), timeout=PATIENCE)
        eventually(lambda: "wedge prior" in (tmp_path / "journal").read_text())
        names = [f"batch-{number}" for number in range(MAX_CONTACTS - 1)]
        flooded = [flood(service, names), flood(service, names), flood(service, names)]
        eventually(lambda: sum(call.done() for call in flooded) == 2)  # have no place beside the first
        eventually(lambda: service.metric("shipshape_queue_depth") == len(names))
        urgent = service.stub.Recognise.future(request(POINTS, COLLISION, contact_id="urgent"), timeout=PATIENCE)
        eventually(lambda: service.metric("shipshape_queue_depth") == len(names) + 1)
        service.release.touch()
        for call in (first, urgent):
            assert call.result().recognition.vessel
        refused = [call for call in flooded if isinstance(call.exception(PATIENCE), grpc.RpcError)]
        assert [call.code() for call in refused] == [grpc.StatusCode.RESOURCE_EXHAUSTED] * 2
        began = (tmp_path / "journal").read_text().splitlines()
        began = began[began.index("wedge prior") :]
        batch = [f"{name} {stage}" for name in names for stage in ("prior", "heading")]
        assert began == ["wedge prior", "urgent prior", "urgent heading", "wedge heading", *batch]
