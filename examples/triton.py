"""One contact through the Open Inference Protocol, with Triton's own client: pip install 'tritonclient[grpc]'.

Example:
    make serve                        # in another terminal
    python examples/triton.py         # or: python examples/triton.py HOST:50051
"""

import math
import sys
from pathlib import Path

import numpy as np
import tritonclient.grpc as triton

PCD = Path(__file__).parent / "contact.pcd"


def main() -> int:
    """Send the contact and print what it is; returns the exit code."""
    address = sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1:50051"
    packed = PCD.read_bytes().partition(b"DATA binary\n")[2]  # little-endian float32 x y z, metres, level frame
    points = np.frombuffer(packed, "<f4").reshape(-1, 3)
    inputs = [tensor("points", "FP32", points), tensor("sensor_height_m", "FP64", np.array([3.0]))]
    try:
        found = triton.InferenceServerClient(address).infer("shipshape", inputs, client_timeout=10.0)
    except triton.InferenceServerException as error:
        print(f"triton: {error.message()}", file=sys.stderr)
        return 1
    vessel = found.as_numpy("vessel")[0].decode()
    heading = math.degrees(found.as_numpy("heading")[0])
    print(f"{vessel} {found.as_numpy('probability')[0]:.4f} {heading:.2f}")
    return 0


def tensor(name: str, datatype: str, array: np.ndarray) -> triton.InferInput:
    """One input of the request."""
    made = triton.InferInput(name, list(array.shape), datatype)
    made.set_data_from_numpy(array)
    return made


if __name__ == "__main__":
    sys.exit(main())
