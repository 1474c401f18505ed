"""What can be tested: one file a protocol, all with the same four methods (`target.Target`).

    grpc://host:port              shipshape.v1: Recognise for one contact, RecogniseScan for several
    grpc+stream://host:port       shipshape.v1: RecogniseStream, a message a request
    http://host:port              REST: packed points for one contact, JSON for several
    oip+http://host:port/MODEL    Open Inference Protocol v2, JSON: any peer that takes `points` and `counts`
    oip+grpc://host:port/MODEL    the same over gRPC, raw

With an s after grpc or http: the same over TLS.
"""

from shipshape.errors import SettingsError
from shipshape.loadtest.targets.address import Address
from shipshape.loadtest.targets.grpc import GrpcTarget
from shipshape.loadtest.targets.oip import OipTarget
from shipshape.loadtest.targets.oip_grpc import OipGrpcTarget
from shipshape.loadtest.targets.rest import RestTarget
from shipshape.loadtest.targets.stream import StreamTarget
from shipshape.loadtest.targets.target import Target


def target_at(address: Address) -> Target:
    """The target at an address, not yet open.

    Raises:
        SettingsError: No protocol of this name.
    """
    match address.scheme:
        case "grpc" | "grpcs":
            return GrpcTarget(address)
        case "grpc+stream" | "grpcs+stream":
            return StreamTarget(address)
        case "http" | "https":
            return RestTarget(address)
        case "oip+http" | "oip+https":
            return OipTarget(address)
        case "oip+grpc" | "oip+grpcs":
            return OipGrpcTarget(address)
    schemes = "grpc, grpc+stream, http, oip+http or oip+grpc, with an s after grpc or http for TLS"
    raise SettingsError(f"expected a target that begins with {schemes}, got {address.scheme}://")
