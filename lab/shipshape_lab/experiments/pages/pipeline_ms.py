"""Section: milliseconds of the whole pipeline."""

from shipshape_lab.experiments.markdown import plain, table
from shipshape_lab.experiments.numbers import Numbers

TITLE = "Milliseconds"
COMMAND = "python benchmarks/pipeline.py --bundle models --out runs/results"


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    key = "pipeline_ms.best.{}.{}".format
    sizes = sorted({name.split(".")[2] for name in numbers if name.startswith("pipeline_ms.best.")}, key=int)
    rows = [(stage, *(plain(numbers, key(size, stage), 3) for size in sizes)) for stage in about["stages"]]
    rows.append(("**whole, median**", *(plain(numbers, f"pipeline_ms.best.{size}", 3) for size in sizes)))
    rows.append(("whole, 95th percentile", *(plain(numbers, key(size, "p95"), 3) for size in sizes)))
    rows.append(("whole, processor time", *(plain(numbers, key(size, "processor"), 3) for size in sizes)))
    machine = about["machine"]
    text = INTRODUCTION.format(runs=about["runs"], **machine)
    return f"{text}\n\n{table(('ms', *(f'{size} points' for size in sizes)), rows)}"


INTRODUCTION = """\
`best`, in process, one thread on one core, median of {runs} runs after warm-up; {processor}, {cores} cores,
{system}. Elapsed time counts; where it is well above the processor time, other programs were running."""
