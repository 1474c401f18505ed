"""shipshape.v1 over gRPC, one call a request: Recognise for one contact, RecogniseScan for several."""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import grpc

from shipshape.errors import FileError
from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Outcome, Reply, answered_on, worst
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


class GrpcPayload(NamedTuple):
    """A message, and whether it is a scan."""

    message: bytes
    scan: bool


class Calls(NamedTuple):
    """The methods of one connection; messages go as the bytes that they are."""

    recognise: grpc.aio.UnaryUnaryMultiCallable[bytes, pb.RecogniseResponse]
    recognise_scan: grpc.aio.UnaryUnaryMultiCallable[bytes, pb.RecogniseScanResponse]


class GrpcTarget:
    """Several connections, used in turn."""

    def __init__(self, address: Address) -> None:
        self._address = address
        token = address.keys.token
        self._metadata = [("authorization", f"Bearer {token}")] if token else []
        self._channels: list[grpc.aio.Channel] = []
        self._calls: Iterator[Calls] = iter(())

    async def open(self) -> TargetInfo:
        """As `Target.open`."""
        self._channels = [_channel(self._address) for _ in range(self._address.connections)]
        self._calls = itertools.cycle([_calls(channel) for channel in self._channels])
        try:
            # The first byte on each connection: what is timed later meets none that is still being opened.
            infos = [await self._model_info(channel) for channel in self._channels]
        except grpc.aio.AioRpcError as error:
            await self.close()
            where = f"{self._address.scheme}://{self._address.host}"
            raise TargetError(
                f"expected shipshape.v1 at {where}, got {error.code().name}: {error.details()}"
            ) from error
        info = infos[0]
        return TargetInfo(info.version, info.bundle_name, info.bundle, info.limits.budget_ms)

    def encode(self, request: Request) -> GrpcPayload:
        """As `Target.encode`."""
        options = pb.Options(lane=f"LANE_{request.lane.upper()}") if request.lane else None
        contacts = [pb.Contact(points=cluster.astype("<f4").tobytes()) for cluster in request.clusters]
        if len(contacts) == 1:
            single = pb.RecogniseRequest(contact=contacts[0], options=options)
            return GrpcPayload(single.SerializeToString(), scan=False)
        scan = pb.RecogniseScanRequest(contacts=contacts, options=options)
        return GrpcPayload(scan.SerializeToString(), scan=True)

    async def send(self, payload: GrpcPayload, deadline_s: float) -> Reply:
        """As `Target.send`."""
        calls = next(self._calls)
        try:
            if payload.scan:
                scan = await calls.recognise_scan(payload.message, timeout=deadline_s, metadata=self._metadata)
                return worst([_of_contact(result) for result in scan.results])
            single = await calls.recognise(payload.message, timeout=deadline_s, metadata=self._metadata)
        except grpc.aio.AioRpcError as error:
            detail = f"{error.code().name}: {error.details()}"
            return Reply(OUTCOMES.get(error.code(), Outcome.ERROR), detail)
        return answered_on([single.recognition.rung])

    async def close(self) -> None:
        """As `Target.close`."""
        for channel in self._channels:
            await channel.close(None)

    async def _model_info(self, channel: grpc.aio.Channel) -> pb.GetModelInfoResponse:
        ask = ShipshapeStub(channel).GetModelInfo  # type: ignore[no-untyped-call]
        info: pb.GetModelInfoResponse = await ask(
            pb.GetModelInfoRequest(), timeout=CONNECT_S, metadata=self._metadata
        )
        return info


def _channel(address: Address) -> grpc.aio.Channel:
    # Channels to one address share one connection unless they are told not to.
    options = [("grpc.use_local_subchannel_pool", 1), ("grpc.enable_http_proxy", 0)]
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


def _calls(channel: grpc.aio.Channel) -> Calls:
    return Calls(
        channel.unary_unary(f"{SERVICE}Recognise", None, pb.RecogniseResponse.FromString),
        channel.unary_unary(f"{SERVICE}RecogniseScan", None, pb.RecogniseScanResponse.FromString),
    )


def _of_contact(result: pb.ContactResult) -> Reply:
    if result.HasField("recognition"):
        return answered_on([result.recognition.rung])
    kind = pb.ErrorKind.Name(result.error.kind)
    return Reply(CONTACT_OUTCOMES.get(result.error.kind, Outcome.ERROR), f"{kind}: {result.error.message}")
