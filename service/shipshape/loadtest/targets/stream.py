"""shipshape.v1 over gRPC, RecogniseStream: one call a connection carries all messages."""

import asyncio
import itertools
from collections.abc import AsyncIterator

import grpc

from shipshape.loadtest.mixture import Request
from shipshape.loadtest.outcomes import Outcome, Reply, worst
from shipshape.loadtest.targets.address import Address
from shipshape.loadtest.targets.channels import (
    SERVICE,
    Channels,
    contacts_of,
    of_contact,
    of_error,
    of_failure,
    options_of,
)
from shipshape.loadtest.targets.target import TargetInfo
from shipshape.v1 import shipshape_pb2 as pb

GRACE_S = 1.0  # after the deadline in which the service may still say that it is late


class StreamTarget:
    """Several connections with a stream each, used in turn."""

    def __init__(self, address: Address) -> None:
        self._channels = Channels(address)

    async def open(self) -> TargetInfo:
        """As `Target.open`."""
        info = await self._channels.open_shipshape()
        self._streams = [Stream(channel, self._channels.metadata) for channel in self._channels.all]
        self._turns = itertools.cycle(self._streams)
        return info

    def encode(self, request: Request) -> bytes:
        """As `Target.encode`."""
        message = pb.RecogniseStreamRequest(contacts=contacts_of(request), options=options_of(request))
        return message.SerializeToString()

    async def send(self, payload: bytes, deadline_s: float) -> Reply:
        """As `Target.send`."""
        return await next(self._turns).send(payload, deadline_s)

    async def close(self) -> None:
        """As `Target.close`."""
        for stream in self._streams:
            stream.end()
        await self._channels.close()


class Stream:
    """Messages on one connection; a call that broke off is replaced with the next message."""

    def __init__(self, channel: grpc.aio.Channel, metadata: list[tuple[str, str]]) -> None:
        self._call = channel.stream_stream(
            f"{SERVICE}RecogniseStream", None, pb.RecogniseStreamResponse.FromString
        )
        self._metadata = metadata
        self._numbers = itertools.count()
        self._waiting: dict[int, asyncio.Future[Reply]] = {}
        self._outgoing: asyncio.Queue[bytes] = asyncio.Queue()
        self._reader: asyncio.Task[None] | None = None

    async def send(self, payload: bytes, deadline_s: float) -> Reply:
        """As `Target.send`."""
        if self._reader is None or self._reader.done():
            self._outgoing = asyncio.Queue()
            self._reader = asyncio.create_task(self._read(self._outgoing))
        number = next(self._numbers)
        # Messages in the wire format that stand one after the other are one message.
        head = pb.RecogniseStreamRequest(sequence=number, timeout_ms=deadline_s * 1e3).SerializeToString()
        self._waiting[number] = answer = asyncio.get_running_loop().create_future()
        self._outgoing.put_nowait(head + payload)
        try:
            return await asyncio.wait_for(answer, deadline_s + GRACE_S)
        except TimeoutError:
            return Reply(Outcome.EXPIRED, f"no answer {GRACE_S:g} s after the deadline")
        finally:
            self._waiting.pop(number, None)

    def end(self) -> None:
        """Break the call off."""
        if self._reader is not None:
            self._reader.cancel()

    async def _read(self, outgoing: asyncio.Queue[bytes]) -> None:
        end = Reply(Outcome.UNAVAILABLE, "the stream ended")
        try:
            async for response in self._call(_messages(outgoing), metadata=self._metadata):
                self._settle(response.sequence, _of_message(response))
        except grpc.aio.AioRpcError as error:
            end = of_failure(error)
        for number in list(self._waiting):
            self._settle(number, end)

    def _settle(self, number: int, reply: Reply) -> None:
        answer = self._waiting.get(number)
        if answer is not None and not answer.done():
            answer.set_result(reply)


async def _messages(outgoing: asyncio.Queue[bytes]) -> AsyncIterator[bytes]:
    while True:
        yield await outgoing.get()


def _of_message(response: pb.RecogniseStreamResponse) -> Reply:
    if response.HasField("error"):
        return of_error(response.error)
    return worst([of_contact(result) for result in response.results])
