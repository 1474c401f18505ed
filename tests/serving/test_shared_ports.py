"""Two services on the same ports, where both are told to share them."""

import pytest

from serving.fakes import cluster, running, until


def test_the_system_spreads_connections_among_services_that_share_their_ports():
    with running(share_ports=True) as first:
        ports = {"rest_port": first.addresses.rest_port, "grpc_port": first.addresses.grpc_port}
        with running(share_ports=True, **ports) as second:

            def both_were_asked() -> bool:
                """Each request of its own connection, over both doors."""
                first.rest.post(
                    "/v1/recognise", json={"points": cluster().tolist()}, headers={"Connection": "close"}
                )
                return bool(first.pipeline.computed) and bool(second.pipeline.computed)

            until(both_were_asked)
            assert second.ask_grpc(cluster())[0].recognition.vessel == "tug"


@pytest.mark.parametrize("door", ["rest_port", "grpc_port"])
def test_ports_are_not_shared_unasked(door):
    with (
        running() as first,
        pytest.raises(OSError, match="expected to listen on"),
        running(**{door: getattr(first.addresses, door)}),
    ):
        pytest.fail("both listen")
