"""LiDAR contacts of the Autoferry data set over time, as `shipshape loadtest --arrivals` plays them.

python benchmarks/autoferry_arrivals.py ../shared/data/lidar/autoferry/scenario2_detections.json harbour.csv
"""

import csv
import json
import sys
from pathlib import Path

LIDAR = 1  # sensorID


def convert(detections: Path, arrivals: Path) -> None:
    """Write one row a LiDAR scan: when it was made, and how many contacts it held."""
    scans = [entry for entry in json.loads(detections.read_text(encoding="utf-8")) if entry["sensorID"] == LIDAR]
    with arrivals.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["seconds", "contacts"])
        for scan in sorted(scans, key=lambda scan: scan["time"]):
            writer.writerow([f"{scan['time']:.6f}", _contacts(scan["measurement"])])


def _contacts(measurement: list[float] | list[list[float]]) -> int:
    """A row north and a row east; of one contact two numbers, of none nothing."""
    if not measurement:
        return 0
    return 1 if isinstance(measurement[0], float) else len(measurement[0])


if __name__ == "__main__":
    convert(Path(sys.argv[1]), Path(sys.argv[2]))
