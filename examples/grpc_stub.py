"""One contact over gRPC with the generated stubs alone, as a program in any language would.

Example:
    make serve                           # in another terminal
    python examples/grpc_stub.py         # or: python examples/grpc_stub.py HOST:50051
"""

import math
import sys
from pathlib import Path

import grpc

from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

PCD = Path(__file__).parent / "contact.pcd"


def main() -> int:
    """Send the contact and print what it is; returns the exit code."""
    address = sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1:50051"
    points = PCD.read_bytes().partition(b"DATA binary\n")[2]  # little-endian float32 x y z, metres, level frame
    request = pb.RecogniseRequest(contact=pb.Contact(points=points, sensor_height_m=3.0))
    with grpc.insecure_channel(address, options=[("grpc.enable_http_proxy", 0)]) as channel:
        try:
            found = ShipshapeStub(channel).Recognise(request, timeout=10.0).recognition
        except grpc.RpcError as error:
            print(f"grpc_stub: {error.code().name}: {error.details()}", file=sys.stderr)
            return 1
    print(f"{found.vessel} {found.probability:.4f} {math.degrees(found.heading):.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
