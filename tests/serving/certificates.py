"""Throw-away authorities, the files a service wants of them, and clients that show a certificate or none."""

import ssl
from dataclasses import dataclass
from pathlib import Path

import grpc
import httpx

from serving.fakes import PATIENCE, cluster, request
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

HOST = "127.0.0.1"
OK, REFUSED = "ok", "no connection"


@dataclass(frozen=True)
class Files:
    """Where a service finds its PEM files; `settings` are those it needs for them."""

    folder: Path

    @property
    def certificate(self):
        return self.folder / "certificate.pem"

    @property
    def key(self):
        return self.folder / "key.pem"

    @property
    def client_ca(self):
        return self.folder / "client_ca.pem"

    def settings(self, *, mutual):
        asked = {"tls_client_ca": self.client_ca} if mutual else {}
        return {"tls_certificate": self.certificate, "tls_key": self.key, **asked}

    def write(self, authority, issued=None, client_authority=None):
        """A certificate for 127.0.0.1 of `authority`, or the one that was issued, and who vouches for clients."""
        issued = issued or authority.issue_cert(HOST)
        self.certificate.write_bytes(b"".join(blob.bytes() for blob in issued.cert_chain_pems))
        self.key.touch(mode=0o600)
        self.key.write_bytes(issued.private_key_pem.bytes())
        self.client_ca.write_bytes((client_authority or authority).cert_pem.bytes())
        return self


def tls_context(authority, shown=None):
    """What a client needs that trusts `authority` and shows the certificate `shown`."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    authority.configure_trust(context)
    if shown is not None:
        shown.configure_cert(context)
    return context


def rest_client(addresses, context):
    return httpx.Client(
        base_url=f"https://{HOST}:{addresses.rest_port}", verify=context, timeout=PATIENCE, trust_env=False
    )


def grpc_channel(addresses, authority, shown=None):
    credentials = grpc.ssl_channel_credentials(
        authority.cert_pem.bytes(),
        shown and shown.private_key_pem.bytes(),
        shown and b"".join(blob.bytes() for blob in shown.cert_chain_pems),
    )
    return grpc.secure_channel(f"{HOST}:{addresses.grpc_port}", credentials)


def through_rest(addresses, authority, shown=None):
    """`OK`, the status, or `REFUSED` when no TLS connection comes about."""
    with rest_client(addresses, tls_context(authority, shown)) as client:
        try:
            status = client.post("/v1/recognise", json={"points": cluster().tolist()}).status_code
        except httpx.TransportError:
            return REFUSED
    return OK if status == 200 else status


def through_grpc(addresses, authority, shown=None):
    """As `through_rest`."""
    with grpc_channel(addresses, authority, shown) as channel:
        call = ShipshapeStub(channel).Recognise.future(request(cluster()), timeout=PATIENCE)
        if call.exception() is None:
            return OK
        return REFUSED if call.code() is grpc.StatusCode.UNAVAILABLE else call.code()


DOORS = {"rest": through_rest, "grpc": through_grpc}
