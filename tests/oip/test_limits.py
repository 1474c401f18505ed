"""The limits of the other doors hold here too, in the same words."""

from oip.wire import FORMS, by_json, scan
from serving.fakes import cluster, running

POINTS = cluster()
GOOD = {"points": POINTS}


def test_limits():
    small = {"max_body_bytes": 65_536, "max_points": 1000, "max_contacts": 2, "queue_limit": 2}
    many = cluster(1001)
    with running(**small) as doors:
        for form in FORMS.values():
            alone = form(doors, {"points": many})
            assert alone.kind == "too_large"
            assert alone.error == "expected at most 1000 points in a contact, got 1001"
            three = form(doors, scan(POINTS, POINTS, POINTS))
            assert (three.kind, three.error) == ("too_large", "expected at most 2 contacts in a scan, got 3")
            huge = form(doors, {"points": cluster(6000)})
            assert huge.kind == "too_large"
            assert huge.error.startswith("expected at most 65536 bytes a request, got ")
            assert form(doors, scan(POINTS, POINTS)).outputs["error"] == ["", ""]
            ids = form(doors, scan(POINTS, POINTS, contact_id=[b""] * 3))
            assert (ids.kind, ids.error) == (three.kind, three.error)
        both = FORMS["grpc_raw"](doors, scan(many, POINTS)).outputs
        assert both["error"] == ["too_large", ""]
        assert by_json(doors, GOOD).status == 200
        counters = doors.rest.get("/metrics").text
    for door in ("oip_rest", "oip_grpc"):
        assert f'shipshape_contacts_total{{door="{door}",outcome="too_large"}}' in counters
