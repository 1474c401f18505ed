"""Does `shipshape batch` need more memory for a long recording than for a short one?

    python -m benchmarks.batch_memory --gigabytes 0.1 10 --out runs/results

Writes an MCAP of whole scans of each size (60,000 points of water, three vessels) into a temporary folder, which
must have room for it, runs the command on it with `--segment`, and looks each second at what its processes hold
together (PSS: pages that several share count once). Prints the highest, and writes OUT/batch_memory.json.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import orjson
import psutil
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore
from tqdm import tqdm

from benchmarks.pipeline import cluster_of, machine

STORE = get_typestore(Stores.ROS2_HUMBLE)
KIND = "sensor_msgs/msg/PointCloud2"
WATER, HULL, HEIGHT = 60_000, 600, 3.0  # points of each; of the sensor above the water, m
BEARINGS = (0.0, 2.1, 4.2)  # of the vessels, rad


def write_recording(path: Path, size: float, seed: int) -> int:
    """Scans until the file has so many bytes; how many there are."""
    definition, _ = STORE.generate_msgdef(KIND, ros_version=2)
    with path.open("wb") as stream, tqdm(total=round(size), unit="B", unit_scale=True, leave=False) as bar:
        writer = Writer(stream, chunk_size=2**20)
        writer.start(profile="ros2")
        schema = writer.register_schema(KIND, "ros2msg", definition.encode())
        channel = writer.register_channel("/points", "cdr", schema)
        count = 0
        for points in _scans(np.random.default_rng(seed)):
            data = bytes(STORE.serialize_cdr(_message(points), KIND))
            writer.add_message(channel, count, data, count)
            count += 1
            bar.update(len(data))
            if stream.tell() >= size:
                break
        writer.finish()
    return count


def peak_of(recording: Path, out: Path) -> tuple[float, float]:
    """The most megabytes that a run held, and its seconds."""
    words = ["batch", str(recording), "--segment", "--sensor-height", f"{HEIGHT:g}", "--out", str(out)]
    started, peak = time.perf_counter(), 0.0
    run = psutil.Popen([sys.executable, "-m", "shipshape", *words], stdout=subprocess.DEVNULL)
    while run.poll() is None:
        with suppress(psutil.Error):  # one of them ended while it was looked at
            family = [run, *run.children(recursive=True)]
            peak = max(peak, sum(member.memory_full_info().pss for member in family) / 1e6)
        time.sleep(1.0)
    if run.returncode != 0:
        raise RuntimeError(f"expected shipshape batch to end with 0, got {run.returncode}")
    return peak, time.perf_counter() - started


def _scans(rng: np.random.Generator) -> Iterator[np.ndarray]:
    hulls = [cluster_of(HULL, heading, rng) for heading in range(7, 360, 30)]
    while True:
        water = rng.uniform(-200.0, 200.0, (WATER, 3))
        water[:, 2] = rng.normal(-HEIGHT, 0.05, WATER)
        vessels = [_turned(hulls[rng.integers(len(hulls))], bearing) for bearing in BEARINGS]
        yield np.concatenate([*vessels, water]).astype("<f4")


def _turned(points: np.ndarray, angle: float) -> np.ndarray:
    (x, y, z), cos, sin = points.T, np.cos(angle), np.sin(angle)
    return np.column_stack([x * cos - y * sin, x * sin + y * cos, z])


def _message(points: np.ndarray) -> object:
    types = STORE.types
    field = types["sensor_msgs/msg/PointField"]
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    return types[KIND](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="lidar"),
        height=1,
        width=len(points),
        fields=[field(name=name, offset=4 * axis, datatype=7, count=1) for axis, name in enumerate("xyz")],
        is_bigendian=False,
        point_step=12,
        row_step=12 * len(points),
        data=points.reshape(-1).view(np.uint8),
        is_dense=True,
    )


def main() -> None:
    """Print a line a size, and write them down."""
    args = _parser().parse_args()
    found: dict[str, object] = {"machine": machine(), "seed": args.seed}
    for gigabytes in args.gigabytes:
        with tempfile.TemporaryDirectory(dir=args.scratch) as scratch:
            recording = Path(scratch) / "scans.mcap"
            scans = write_recording(recording, gigabytes * 1e9, args.seed)
            peak, seconds = peak_of(recording, Path(scratch) / "results")
        print(f"{gigabytes:g} GB, {scans} scans: at most {peak:.0f} MB, {seconds:.0f} s")
        found[f"{gigabytes:g}_gb"] = {"scans": scans, "peak_pss_mb": peak, "seconds": seconds}
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "batch_memory.json").write_bytes(orjson.dumps(found, option=orjson.OPT_INDENT_2))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description="Measures what a batch run holds in memory.",
        epilog="example: python -m benchmarks.batch_memory --gigabytes 0.1 10 --out runs/results",
    )
    parser.add_argument("--gigabytes", type=float, nargs="+", default=[0.1, 1.0], help="sizes (default 0.1 1)")
    parser.add_argument("--out", type=Path, default=Path("runs/results"), help="folder for results")
    parser.add_argument(
        "--scratch", type=Path, help="folder with room for the largest (default: that of the system)"
    )
    parser.add_argument("--seed", type=int, default=5, help="of the scans (default 5)")
    return parser


if __name__ == "__main__":
    main()
