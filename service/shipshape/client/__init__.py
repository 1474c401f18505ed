"""Calls Shipshape services from Python: typed answers, several endpoints, deadlines, safe retries, a stream.

    from shipshape.client import Client, Contact

    with Client("grpc://127.0.0.1:50051") as client:
        answer = client.recognise(Contact(points, sensor_height=3.0), timeout_s=0.2)
        print(answer.vessel, answer.probability)

`AsyncClient` is the same for asyncio; docs/client.md explains both. What computes is not loaded with them.
"""

from shipshape.client.aio import AsyncClient
from shipshape.client.answers import Answer, Capacity, EndpointStatus, Info, Refusal, ScanAnswer
from shipshape.client.endpoint import Endpoint
from shipshape.client.links import LAN, SATELLITE, Link
from shipshape.client.sync import Client
from shipshape.client.wishes import Wishes
from shipshape.executor import Lane
from shipshape.types import Contact, ImageMethod, Preset, Reason, Rung

__all__ = [
    "LAN",
    "SATELLITE",
    "Answer",
    "AsyncClient",
    "Capacity",
    "Client",
    "Contact",
    "Endpoint",
    "EndpointStatus",
    "ImageMethod",
    "Info",
    "Lane",
    "Link",
    "Preset",
    "Reason",
    "Refusal",
    "Rung",
    "ScanAnswer",
    "Wishes",
]
