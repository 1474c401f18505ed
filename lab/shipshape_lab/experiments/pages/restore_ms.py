"""Section: how long restoring one cluster takes, beside PCN and SnowflakeNet."""

from shipshape_lab.experiments.markdown import figure, plain, table
from shipshape_lab.experiments.numbers import Numbers

TITLE = "Restoration time"
COMMAND = "python -m shipshape_lab.experiments.restore_ms --data runs/data --bundle models --out runs/results"
_ROWS = {
    "best": "`best`: projection, inpainting, lifting",
    "pcn_onnx": "PCN, ONNX Runtime",
    "pcn_torch": "PCN, torch",
    "snowflakenet_onnx": "SnowflakeNet, ONNX Runtime",
    "snowflakenet_torch": "SnowflakeNet, torch",
    "pcn_reduced": "PCN, the reduced size that was trained, torch",
    "snowflakenet_reduced": "SnowflakeNet, the reduced size that was trained, torch",
    "pcn.gpu": "PCN, torch, GPU",
    "snowflakenet.gpu": "SnowflakeNet, torch, GPU",
}


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    shown = {name: title for name, title in _ROWS.items() if f"P.restore_ms.{name}" in numbers}
    rows = [
        (title, *(plain(numbers, f"P.{kind}.{name}") for kind in ("restore_ms", "restore_elapsed_ms")))
        for name, title in shown.items()
    ]
    times = {model: plain(numbers, f"P.restore_times_faster.{model}", 0) for model in ("pcn", "snowflakenet")}
    return f"""\
Median of {about["turns"]} clusters of P thinned to exactly 2,048 points, one thread, batch 1, the systems taking
turns in one run on {about["machine"]}. PCN and SnowflakeNet are of their published size unless it says reduced,
with untrained weights, and only the network is timed; `best` is timed from the pose to the restored cloud. Where
PCN's public code multiplies the same features again for each point, this one does it once, which makes it faster.
SnowflakeNet's search for neighbours and farthest points is plain torch or ONNX here, not a compiled kernel.

{table(("system", "ms", "elapsed, ms"), rows)}

{figure("restore_ms.png", "milliseconds for one cluster")}

`best` is {times["pcn"]} times as fast as PCN and {times["snowflakenet"]} times as fast as SnowflakeNet, each in
the faster of its two forms. *ms* is the time that the one thread had the processor, which counts; elapsed times
above it say that the machine had other work, and on a GPU they are what counts.
{_gpu(numbers)}"""


def _gpu(numbers: Numbers) -> str:
    if any(key.startswith("P.restore_ms.") and key.endswith(".gpu") for key in numbers):
        return ""
    return "No GPU was at hand; where there is one, the same command adds it."
