"""Who comes in through the gRPC door: TLS, and a token for every call but those of health."""

import logging
from typing import Any, NoReturn

import grpc
from grpc_health.v1 import health

from shipshape.errors import Unauthenticated
from shipshape.serving.access import Access
from shipshape.serving.faults import fault_of
from shipshape.serving.grpc.callers import address_of, authorizations
from shipshape.serving.grpc.guard import identify, refuse
from shipshape.serving.tls import Tls, TlsMaterial

OPEN = f"/{health.SERVICE_NAME}/"  # probes hold no tokens

_logger = logging.getLogger(__name__)


class Doorkeeper(grpc.ServerInterceptor):  # type: ignore[type-arg]  # generic in the stubs only
    """Refuses a call without a good token before its message is read, whichever service it is meant for."""

    def __init__(self, access: Access) -> None:
        self._access = access

    def intercept_service(self, continuation: Any, handler_call_details: Any) -> Any:
        """The method's handler, or one that refuses."""
        if not handler_call_details.method.startswith(OPEN):
            try:
                self._access.holder(authorizations(handler_call_details.invocation_metadata))
            except Unauthenticated as error:
                return _refusal(error)
        return continuation(handler_call_details)


def credentials(tls: Tls) -> grpc.ServerCredentials:
    """What a port needs for TLS; each new connection gets what the files hold by then."""
    shown = tls.newest()

    # The stubs forget that None is an answer: as before.
    def renewed() -> Any:
        """What to show from now on, None as long as the files are the same."""
        nonlocal shown
        if (newest := tls.newest()) is shown:
            return None
        shown = newest
        return _configuration(newest)

    return grpc.dynamic_ssl_server_credentials(_configuration(shown), renewed, tls.asks_clients)


def _configuration(material: TlsMaterial) -> grpc.ServerCertificateConfiguration:
    return grpc.ssl_server_certificate_configuration(
        [(material.key, material.certificate)], root_certificates=material.client_ca
    )


def _refusal(error: Unauthenticated) -> Any:
    def end(_: Any, context: grpc.ServicerContext) -> NoReturn:
        """Refuse the call before its message is read."""
        identify(context)
        _logger.debug("refused %s: %s", address_of(context), error)
        refuse(context, fault_of(error))

    # Of a stream, whatever the method is: a handler of one message would wait for it.
    return grpc.stream_stream_rpc_method_handler(end)
