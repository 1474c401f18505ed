"""shipshape.v1 over gRPC, one call a request: Recognise for one contact, RecogniseScan for several."""

import itertools
from typing import NamedTuple

import grpc

from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Reply, answered_on, worst
from shipshape.loadtest.targets.address import Address
from shipshape.loadtest.targets.channels import SERVICE, Channels, contacts_of, of_contact, of_failure, options_of
from shipshape.loadtest.targets.target import TargetInfo
from shipshape.v1 import shipshape_pb2 as pb


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
        self._channels = Channels(address)

    async def open(self) -> TargetInfo:
        """As `Target.open`."""
        info = await self._channels.open_shipshape()
        self._calls = itertools.cycle([_calls(channel) for channel in self._channels.all])
        return info

    def encode(self, request: Request) -> GrpcPayload:
        """As `Target.encode`."""
        contacts, options = contacts_of(request), options_of(request)
        if len(contacts) == 1:
            single = pb.RecogniseRequest(contact=contacts[0], options=options)
            return GrpcPayload(single.SerializeToString(), scan=False)
        scan = pb.RecogniseScanRequest(contacts=contacts, options=options)
        return GrpcPayload(scan.SerializeToString(), scan=True)

    async def send(self, payload: GrpcPayload, deadline_s: float) -> Reply:
        """As `Target.send`."""
        calls, metadata = next(self._calls), self._channels.metadata
        try:
            if payload.scan:
                scan = await calls.recognise_scan(payload.message, timeout=deadline_s, metadata=metadata)
                return worst([of_contact(result) for result in scan.results])
            single = await calls.recognise(payload.message, timeout=deadline_s, metadata=metadata)
        except grpc.aio.AioRpcError as error:
            return of_failure(error)
        return answered_on([single.recognition.rung])

    async def close(self) -> None:
        """As `Target.close`."""
        await self._channels.close()


def _calls(channel: grpc.aio.Channel) -> Calls:
    return Calls(
        channel.unary_unary(f"{SERVICE}Recognise", None, pb.RecogniseResponse.FromString),
        channel.unary_unary(f"{SERVICE}RecogniseScan", None, pb.RecogniseScanResponse.FromString),
    )
