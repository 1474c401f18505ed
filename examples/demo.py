"""A scan of contacts through a real service and a real client, start to stop, with a picture of each contact.

Example:
    python examples/demo.py          # or: make demo
    python examples/demo.py --keep   # leave the service running until Ctrl-C
"""

import argparse
import json
import math
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import grpc
import numpy as np

from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1 import shipshape_pb2_grpc

CONTACTS = Path(__file__).parent / "contacts.npz"
OUT = Path("out/demo")
READY_WITHIN_S = 180.0  # the first start on a machine compiles the inner loops
STOP_WITHIN_S = 30.0
OWN_TRUE_HEADING_DEG = 245.0  # of the vessel that carries the LiDAR; any will do

# Loopback never goes through a proxy, whatever the environment says.
http = urllib.request.build_opener(urllib.request.ProxyHandler({}))


class DemoFailed(Exception):
    """The service did not do what it should."""


def main() -> int:
    """Run the demo; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", action="store_true", help="leave the service running until Ctrl-C")
    keep = parser.parse_args().keep
    OUT.mkdir(parents=True, exist_ok=True)
    rest, grpc_address = free_address(), free_address()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: leave no service behind
    try:
        with service(rest, grpc_address) as process:
            show_scan(grpc_address)
            show_single(rest)
            print(f"\npictures: {', '.join(str(path) for path in sorted(OUT.glob('*.png')))}")
            if keep:
                print(f"\nserving until Ctrl-C: REST http://{rest}/openapi.json, gRPC {grpc_address}")
                wait_for_interrupt(process)
    except DemoFailed as error:
        print(f"demo: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    print("service stopped with exit code 0")
    return 0


@contextmanager
def service(rest: str, grpc_address: str) -> Iterator[subprocess.Popen[bytes]]:
    """A running, ready service; stopped by SIGTERM, and held to exit code 0, at the end."""
    rest_port, grpc_port = (address.rpartition(":")[2] for address in (rest, grpc_address))
    command = [sys.executable, "-m", "shipshape", "serve", "--rest-port", rest_port, "--grpc-port", grpc_port]
    log = OUT / "service.log"
    print(f"starting the service on loopback, REST port {rest_port}, gRPC port {grpc_port} ...", flush=True)
    # A session of its own keeps Ctrl-C from the service: it is stopped once, below.
    with log.open("wb") as stream, subprocess.Popen(command, stderr=stream, start_new_session=True) as process:
        try:
            wait_until_ready(process, rest, log)
            yield process
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                code = process.wait(STOP_WITHIN_S)
            except subprocess.TimeoutExpired:
                process.kill()
                code = process.wait()
    if code != 0:
        raise DemoFailed(f"expected the service to stop with exit code 0, got {code}; see {log}")


def wait_until_ready(process: subprocess.Popen[bytes], rest: str, log: Path) -> None:
    """Poll /readyz."""
    started = time.monotonic()
    while time.monotonic() - started < READY_WITHIN_S:
        if process.poll() is not None:
            raise DemoFailed(f"the service did not start: {log.read_text(errors='replace').strip()[-2000:]}")
        try:
            with http.open(f"http://{rest}/readyz", timeout=2.0):
                print(f"ready after {time.monotonic() - started:.1f} s\n")
                return
        except OSError:  # refused: not listening yet; or 503: still warming up
            time.sleep(0.1)
    raise DemoFailed(f"expected a ready service within {READY_WITHIN_S:.0f} s; see {log}")


def show_scan(address: str) -> None:
    """All contacts of one scan in one gRPC call, and a picture of each."""
    sample = np.load(CONTACTS, allow_pickle=False)
    clusters = np.split(sample["points"], np.cumsum(sample["n"])[:-1])
    request = pb.RecogniseScanRequest(
        contacts=[
            pb.Contact(
                contact_id=str(index + 1),
                points=cluster.astype("<f4").tobytes(),
                sensor_height_m=float(sample["sensor_height"]),
                own_true_heading_deg=OWN_TRUE_HEADING_DEG,
            )
            for index, cluster in enumerate(clusters)
        ],
        options=pb.Options(include_png=True),
    )
    with grpc.insecure_channel(address, options=[("grpc.enable_http_proxy", 0)]) as channel:
        started = time.perf_counter()
        response = shipshape_pb2_grpc.ShipshapeStub(channel).RecogniseScan(request, timeout=60.0)
        elapsed_ms = (time.perf_counter() - started) * 1e3
    print(f"gRPC RecogniseScan: {len(clusters)} contacts in {elapsed_ms:.0f} ms, pictures included\n")
    truths = list(zip(sample["vessel"].tolist(), sample["heading"].tolist(), strict=True))
    print_answers(response.results, truths)
    print_stages(response.results)
    for result in response.results:
        (OUT / f"contact-{result.contact_id}.png").write_bytes(result.recognition.rendered_png)


def show_single(address: str) -> None:
    """The first contact once more, over REST: packed points in the body, everything else in the query."""
    sample = np.load(CONTACTS, allow_pickle=False)
    points = sample["points"][: sample["n"][0]]
    query = urllib.parse.urlencode({"contact_id": "1", "sensor_height_m": float(sample["sensor_height"])})
    request = urllib.request.Request(
        f"http://{address}/v1/recognise?{query}",
        data=points.astype("<f4").tobytes(),
        headers={"Content-Type": "application/octet-stream"},
    )
    started = time.perf_counter()
    try:
        with http.open(request, timeout=60.0) as response:
            answer, timing = json.load(response), response.headers["Server-Timing"]
    except urllib.error.HTTPError as error:
        raise DemoFailed(f"expected an answer over REST, got {error.code}: {error.read().decode()}") from error
    elapsed_ms = (time.perf_counter() - started) * 1e3
    print(f"\nREST POST /v1/recognise: contact 1 is a {answer['vessel']} ({answer['probability']:.1%}),", end=" ")
    print(f"heading {math.degrees(answer['heading']):+.1f}°, in {elapsed_ms:.1f} ms\nServer-Timing: {timing}")


def print_answers(results: list[pb.ContactResult], truths: list[tuple[str, float]]) -> None:
    """A line a contact, with the truth beside it."""
    line = "{:7}  {:30} {:>6}  {:>14} {:>6} {:>6}  {:>18} {:>8} {:>8}  {:28}  {}".format
    print(
        line(
            "contact",
            "vessel",
            "prob.",
            "heading",
            "true",
            "aspect",
            "L x B x H, m",
            "measured",
            "inferred",
            "truth",
            "unsure because",
        )
    )
    for result, (vessel, heading) in zip(results, truths, strict=True):
        truth = f"{vessel}, {math.degrees(heading):+.1f}°"
        if result.WhichOneof("outcome") == "error":
            raise DemoFailed(f"expected an answer for contact {result.contact_id}, got: {result.error.message}")
        found = result.recognition
        chances = {entry.name: entry.probability for entry in found.probabilities}
        print(
            line(
                result.contact_id,
                f"unknown (most like {found.vessel})" if found.unknown else found.vessel,
                f"{chances['unknown'] if found.unknown else found.probability:.1%}",
                f"{math.degrees(found.heading):+.1f} ± {math.degrees(found.heading_std):.1f}°",
                f"{found.true_heading_deg:.0f}°",
                f"{found.aspect_deg:.0f}°",
                f"{found.box.length:.1f} x {found.box.beam:.1f} x {found.box.height:.1f}",
                found.measured_points,
                found.inferred_points,
                truth,
                ", ".join(pb.Reason.Name(reason).removeprefix("REASON_").lower() for reason in found.reasons),
            )
        )


def print_stages(results: list[pb.ContactResult]) -> None:
    """Milliseconds of each stage, a line a contact."""
    stages = [entry.stage for entry in results[0].recognition.stages]
    print(f"\n{'ms':7}  {'  '.join(stages)}  total")
    for result in results:
        times = [entry.milliseconds for entry in result.recognition.stages]
        cells = [f"{ms:{len(stage)}.2f}" for stage, ms in zip(stages, times, strict=True)]
        print(f"{result.contact_id:7}  {'  '.join(cells)}  {sum(times):5.2f}")


def free_address() -> str:
    """A loopback address on which nothing listens right now."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return f"127.0.0.1:{listener.getsockname()[1]}"


def wait_for_interrupt(process: subprocess.Popen[bytes]) -> None:
    """Until Ctrl-C, or until the service ends by itself."""
    try:
        process.wait()
    except KeyboardInterrupt:
        print()


if __name__ == "__main__":
    sys.exit(main())
