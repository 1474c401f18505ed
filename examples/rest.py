"""One contact over REST with nothing but Python's own library.

Example:
    make serve                      # in another terminal
    python examples/rest.py         # or: python examples/rest.py http://HOST:8080
"""

import json
import math
import sys
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

PCD = Path(__file__).parent / "contact.pcd"


def main() -> int:
    """Send the contact and print what it is; returns the exit code."""
    url = sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8080"
    points = PCD.read_bytes().partition(b"DATA binary\n")[2]  # little-endian float32 x y z, metres, level frame
    query = urllib.parse.urlencode({"sensor_height_m": 3})
    request = urllib.request.Request(f"{url}/v1/recognise?{query}", points, method="POST")
    request.add_header("Content-Type", "application/octet-stream")
    request.add_header("Shipshape-Timeout-Ms", "10000")
    try:
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=15.0) as response:
            found = json.load(response)
    except urllib.error.HTTPError as error:  # a problem document says why, in `detail`
        print(f"rest: {json.load(error)['detail']}", file=sys.stderr)
        return 1
    except urllib.error.URLError as error:
        print(f"rest: expected a service at {url}, got: {error.reason}", file=sys.stderr)
        return 1
    print(f"{found['vessel']} {found['probability']:.4f} {math.degrees(found['heading']):.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
