"""Connections over gRPC, and what the messages of shipshape.v1 have in common."""

from collections.abc import Awaitable, Callable

import grpc

from shipshape.errors import FileError
from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Outcome, Reply, answered_on
from shipshape.loadtest.targets.address import Address, Keys
from shipshape.loadtest.targets.target import CONNECT_S, TargetError, TargetInfo
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

SERVICE = "/shipshape.v1.Shipshape/"
OUTCOMES = {
    grpc.StatusCode.RESOURCE_EXHAUSTED: Outcome.REFUSED,
    grpc.StatusCode.DEADLINE_EXCEEDED: Outcome.EXPIRED,
    grpc.StatusCode.UNAVAILABLE: Outcome.UNAVAILABLE,
}
CONTACT_OUTCOMES = {
    pb.ERROR_KIND_OVERLOADED: Outcome.REFUSED,
    pb.ERROR_KIND_DEADLINE_EXCEEDED: Outcome.EXPIRED,
    pb.ERROR_KIND_NOT_READY: Outcome.UNAVAILABLE,
}
Describe = Callable[[grpc.aio.Channel], Awaitable[TargetInfo]]


class Channels:
    """Several connections to one address."""

    def __init__(self, address: Address) -> None:
        self._address = address
        token = address.keys.token
        self.metadata = [("authorization", f"Bearer {token}")] if token else []
        self.all: list[grpc.aio.Channel] = []

    async def open(self, protocol: str, describe: Describe) -> TargetInfo:
        """Connect them all, and ask on each what the target is.

        Raises:
            TargetError: Nobody answers, or not in `protocol`.
        """
        self.all = [_channel(self._address) for _ in range(self._address.connections)]
        try:
            # The first byte on each connection: what is timed later meets none that is still being opened.
            infos = [await describe(channel) for channel in self.all]
        except grpc.aio.AioRpcError as error:
            await self.close()
            where = f"{self._address.scheme}://{self._address.host}"
            raise TargetError(
                f"expected {protocol} at {where}, got {error.code().name}: {error.details()}"
            ) from error
        return infos[0]

    async def open_shipshape(self) -> TargetInfo:
        """As `open`, of the typed service."""
        return await self.open("shipshape.v1", self._model_info)

    async def close(self) -> None:
        """Disconnect."""
        for channel in self.all:
            await channel.close(None)

    async def _model_info(self, channel: grpc.aio.Channel) -> TargetInfo:
        ask = ShipshapeStub(channel).GetModelInfo  # type: ignore[no-untyped-call]
        info: pb.GetModelInfoResponse = await ask(
            pb.GetModelInfoRequest(), timeout=CONNECT_S, metadata=self.metadata
        )
        return TargetInfo(info.version, info.bundle_name, info.bundle, info.limits.budget_ms)


def contacts_of(request: Request) -> list[pb.Contact]:
    """The contacts of a request."""
    return [pb.Contact(points=cluster.astype("<f4").tobytes()) for cluster in request.clusters]


def options_of(request: Request) -> pb.Options | None:
    """The options of a request; None: the service's defaults."""
    return pb.Options(lane=f"LANE_{request.lane.upper()}") if request.lane else None


def of_failure(error: grpc.aio.AioRpcError) -> Reply:
    """How a call counts that ended with a status."""
    return Reply(OUTCOMES.get(error.code(), Outcome.ERROR), f"{error.code().name}: {error.details()}")


def of_contact(result: pb.ContactResult) -> Reply:
    """How one contact of a scan counts."""
    return of_error(result.error) if result.HasField("error") else answered_on([result.recognition.rung])


def of_error(error: pb.ContactError) -> Reply:
    """How a contact counts that got no answer."""
    known = error.kind in pb.ErrorKind.values()  # a newer service may have others
    kind = pb.ErrorKind.Name(error.kind) if known else f"error {error.kind}"
    return Reply(CONTACT_OUTCOMES.get(error.kind, Outcome.ERROR), f"{kind}: {error.message}")


def _channel(address: Address) -> grpc.aio.Channel:
    options = [
        ("grpc.use_local_subchannel_pool", 1),  # channels to one address share one connection unless told not to
        ("grpc.enable_http_proxy", 0),
        ("grpc.max_receive_message_length", -1),  # the answer to a scan may be over gRPC's 4 MiB
    ]
    if address.secure:
        return grpc.aio.secure_channel(address.host, _credentials(address.keys), options)
    return grpc.aio.insecure_channel(address.host, options)


def _credentials(keys: Keys) -> grpc.ChannelCredentials:
    try:
        ca, certificate, key = (
            None if path is None else path.read_bytes() for path in (keys.ca, keys.certificate, keys.key)
        )
    except OSError as error:
        raise FileError(f"expected PEM files for TLS, got: {error}") from error
    return grpc.ssl_channel_credentials(ca, key, certificate)
