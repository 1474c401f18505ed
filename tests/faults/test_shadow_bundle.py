"""A shadow bundle in a real process: whatever is asked meanwhile, callers and their counts are as without it."""

from faults.live import POINTS, eventually, live
from serving.fakes import request

CALLS = 40  # of each kind: they find room in the queue


def shadow(service, path, **body):
    answer = service.admin.post(f"/admin/{path}", json=body)
    assert answer.status_code == 200, answer.text
    return answer.json()["shadow"]


def test_no_contact_of_a_caller_is_lost_or_counted_twice(tmp_path):
    folder = tmp_path / "bundle"
    folder.mkdir()  # the fake bundle is in no folder
    with live(tmp_path, SHADOW_SHARE="1", BUNDLE=str(folder)) as service, service.survives(internal=None):
        before = service.counts()
        assert shadow(service, "shadow", folder="bundle")["compared"] == 0
        asked = [request(POINTS, contact_id=name, sensor_height_m=3.0) for name in ("slow", "crash") * CALLS]
        codes = [call.exception() is None for call in [service.stub.Recognise.future(each) for each in asked]]
        assert codes == [True, False] * CALLS
        eventually(lambda: service.metric("shipshape_running") == 0)
        since = service.counts().since(before)
        assert (since.offered, since.completed, since.failed) == (2 * CALLS, CALLS, CALLS)
        service.ask_rest(sensor_height_m=3.0)
        eventually(lambda: service.metric("shipshape_shadow_compared_total") >= CALLS)
        assert shadow(service, "unshadow") is None
