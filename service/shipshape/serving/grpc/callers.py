"""Who a gRPC call comes from: its token, its verified certificate, or its address."""

from collections.abc import Iterable
from typing import Any
from urllib.parse import unquote

import grpc

from shipshape.serving.access import Access


def client_of(context: grpc.ServicerContext, access: Access) -> str:
    """The name that limits hold for; raises Unauthenticated."""
    given = authorizations(context.invocation_metadata() or ())
    return access.client(given, _certificate_name(context), address_of(context))


def authorizations(metadata: Iterable[Any]) -> list[str]:
    """All values of `authorization` in the metadata of a call."""
    return [value for key, value in metadata if key == "authorization" and isinstance(value, str)]


def address_of(context: grpc.ServicerContext) -> str:
    """Where the call comes from, without the port."""
    where = unquote(context.peer()).partition(":")[2]  # ipv4:127.0.0.1:4711, ipv6:%5B::1%5D:4711
    return where.rpartition(":")[0].strip("[]")


def _certificate_name(context: grpc.ServicerContext) -> str | None:
    shown = context.auth_context()  # empty unless the client's certificate was asked for, and verified
    names = [*shown.get("x509_common_name", ()), *shown.get("x509_subject_alternative_name", ())]
    return next((name.decode(errors="replace") for name in names if name), None)  # no common name comes as empty
