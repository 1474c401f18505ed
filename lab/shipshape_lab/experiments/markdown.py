"""docs/results.md: tables, figures and plain statements from the numbers, and nothing that is not in them."""

from collections.abc import Iterable, Sequence

from shipshape_lab.experiments.numbers import ASPECT_EDGES, DISTANCES, Numbers, aspect_names
from shipshape_lab.experiments.restoration_p import CLOUDS, REFERENCE_POINTS
from shipshape_lab.experiments.systems import SYSTEMS
from shipshape_lab.experiments.targets import TARGETS
from shipshape_lab.experiments.weaknesses import spoken, weaknesses

# Sensors 2026, 26(5), 1637, as far as its text gives figures; other hulls and another simulator than ours.
PUBLISHED = {
    ("raw_spd2", "overall"): "97.15",
    ("raw_spd2", "beyond_70m"): "95.17",
    ("raw_spd2", "bow_on"): "95.26",
    ("raw_spd2", "stern_on"): "91.51",
    ("full_side", "overall"): "97.06",
    ("full_side", "beyond_70m"): "96.76",
    ("full_side", "bow_on"): "96.89",
    ("z_side", "overall"): "96.20",
    ("z_side", "stern_on"): "98.41",
    ("full_top", "overall"): "95.23",
    ("z_top", "overall"): "90.18",
}
_PARTS = ("overall", "beyond_70m", "bow_on", "stern_on")
_DISTANCES = tuple(f"{distance}m" for distance in DISTANCES)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; the first column to the left, the others to the right."""
    rule = [":---", *["---:"] * (len(header) - 1)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (header, rule, *rows))


def percent(numbers: Numbers, key: str) -> str:
    """A share as a percentage, - where it was not measured."""
    return f"{100 * numbers[key]:.2f}" if key in numbers else "-"


def plain(numbers: Numbers, key: str, digits: int = 2) -> str:
    """A number, - where it was not measured."""
    return f"{numbers[key]:.{digits}f}" if key in numbers else "-"


def targets(numbers: Numbers) -> str:
    """Each promise with its value and verdict."""
    rows = [(target.text, target.wanted, *target.verdict(numbers)) for target in TARGETS]
    return table(("target", "wanted", "measured", "verdict"), rows)


def accuracy(numbers: Numbers) -> str:
    """Accuracy by system beside the paper's published figures."""
    rows = []
    for system in SYSTEMS:
        cells = [percent(numbers, f"P.accuracy.{system}.{part}") for part in _PARTS]
        rows.append(
            (f"`{system}`", *(_beside(cell, system, part) for cell, part in zip(cells, _PARTS, strict=True)))
        )
    return table(("right vessel, %", "all", "beyond 70 m", "bow-on", "stern-on"), rows)


def _beside(cell: str, system: str, part: str) -> str:
    published = PUBLISHED.get((system, part))
    return f"{cell} *({published})*" if published else cell


def accuracy_by(numbers: Numbers, parts: Sequence[str]) -> str:
    """Accuracy of every system, one column a slice."""
    rows = [(f"`{s}`", *(percent(numbers, f"P.accuracy.{s}.{part}") for part in parts)) for s in SYSTEMS]
    return table(("right vessel, %", *map(spoken, parts)), rows)


def pose(numbers: Numbers, parts: Sequence[str]) -> str:
    """Heading, bow and centre of `best` and `paper`, one row a slice."""
    systems = ("best", "paper")
    header = [
        f"{what}, {s}" for what in ("median, deg", "within 5 deg", "within 10 deg", "bow right") for s in systems
    ]
    rows = []
    for part in parts:
        end = "" if part == "overall" else f".{part}"
        cells = [plain(numbers, f"P.heading.{s}.median_deg{end}") for s in systems]
        cells += [percent(numbers, f"P.heading.{s}.within_{n}deg{end}") for n in (5, 10) for s in systems]
        cells += [percent(numbers, f"P.bow_stern.{s}{end}") for s in systems]
        rows.append((spoken(part), *cells))
    return table(("slice", *header), rows)


def box(numbers: Numbers) -> str:
    """Median errors of the box."""
    sides = [f"box.{{}}.{side}_median_error_m" for side in ("length", "beam", "height")]
    keys = ["center.{}.median_m", *sides]
    rows = [(f"`{s}`", *(plain(numbers, f"P.{key.format(s)}") for key in keys)) for s in ("best", "paper")]
    return table(("median error, m", "centre (horizontal)", "length", "beam", "height"), rows)


def confidence(numbers: Numbers) -> str:
    """Calibration, rejection, and accuracy if an answer of "unknown" counts as wrong."""
    rows = [
        (
            f"`{s}`",
            percent(numbers, f"P.ece.{s}"),
            percent(numbers, f"P.unknown_share.{s}"),
            percent(numbers, f"P.accuracy_named.{s}.overall"),
        )
        for s in SYSTEMS
    ]
    return table(("%", "calibration error", "called unknown", "right and not called unknown"), rows)


def height_told(numbers: Numbers) -> str:
    """`best` with and without the sensor's height; empty if it was not run."""
    if "P_height_told.clusters" not in numbers:
        return ""
    keys = [f"accuracy.best.{part}" for part in _PARTS] + ["heading.best.within_5deg", "bow_stern.best"]
    names = {"P": "not told", "P_height_told": "told"}
    rows = [(text, *(percent(numbers, f"{name}.{key}") for key in keys)) for name, text in names.items()]
    header = ("`best`, %", "all", "beyond 70 m", "bow-on", "stern-on", "heading within 5 deg", "bow right")
    return "\n\n" + table(("sensor height " + header[0], *header[1:]), rows)


def restoration(numbers: Numbers) -> str:
    """Scores of every cloud."""
    rows = []
    for cloud in CLOUDS:
        cells = [plain(numbers, f"P.cd_l1.{cloud}"), plain(numbers, f"P.cd_l2.{cloud}", 3)]
        cells += [plain(numbers, f"P.fscore.{cloud}", 3), plain(numbers, f"P.points.{cloud}", 0)]
        rows.append((f"`{cloud}`", *cells))
    return table(("cloud", "CD-L1 x 1000", "CD-L2 x 1000", "F-score@1%", "points"), rows)


def restoration_by(numbers: Numbers, parts: Sequence[str]) -> str:
    """CD-L1 of every cloud, one column a slice."""
    rows = [(f"`{c}`", *(plain(numbers, f"P.cd_l1.{c}.{part}", 1) for part in parts)) for c in CLOUDS]
    return table(("CD-L1 x 1000", *map(spoken, parts)), rows)


def latency(numbers: Numbers, sizes: Sequence[str], stages: Sequence[str]) -> str:
    """Milliseconds by stage, one column a size of cluster."""
    key = "pipeline_ms.best.{}.{}".format
    rows = [(stage, *(plain(numbers, key(size, stage), 3) for size in sizes)) for stage in stages]
    rows.append(("**whole, median**", *(plain(numbers, f"pipeline_ms.best.{size}", 3) for size in sizes)))
    rows.append(("whole, 95th percentile", *(plain(numbers, key(size, "p95"), 3) for size in sizes)))
    rows.append(("whole, processor time", *(plain(numbers, key(size, "processor"), 3) for size in sizes)))
    return table(("ms", *(f"{size} points" for size in sizes)), rows)


def figure(name: str, alt: str, drawn: Sequence[str]) -> str:
    """A link to a figure, if it was drawn."""
    return f"![{alt}](figures/{name})" if name in drawn else ""


def page(numbers: Numbers, about: dict, drawn: Sequence[str]) -> str:
    """The whole page.

    Args:
        numbers: flat numbers.
        about: texts of the template (`machine`, `bundle`, ...), `catalogue`, `sizes` and `stages`.
        drawn: figures that are there.
    """
    parts = (*_DISTANCES, *aspect_names())
    bullets = "\n".join(f"- {sentence}" for sentence in weaknesses(numbers, about["catalogue"]))
    return TEMPLATE.format(
        **about,
        targets=targets(numbers),
        weaknesses=bullets,
        accuracy=accuracy(numbers),
        accuracy_by_distance=accuracy_by(numbers, _DISTANCES),
        accuracy_by_aspect=accuracy_by(numbers, aspect_names()),
        accuracy_by_vessel=accuracy_by(numbers, about["catalogue"]),
        accuracy_figure=figure("accuracy.png", "accuracy by distance and by aspect", drawn),
        pose=pose(numbers, ("overall", "beyond_70m", "bow_on", "stern_on", *parts)),
        heading_figure=figure("heading.png", "heading error by distance and by aspect", drawn),
        box=box(numbers),
        confidence=confidence(numbers),
        height_told=height_told(numbers),
        restoration=restoration(numbers),
        restoration_by_distance=restoration_by(numbers, _DISTANCES),
        restoration_by_aspect=restoration_by(numbers, aspect_names()),
        restoration_figure=figure("restoration.png", "CD-L1 and F-score by distance", drawn),
        gallery_figure=figure("gallery.png", "measured, restored and true clouds", drawn),
        latency=latency(numbers, about["sizes"], about["stages"]),
        clusters=numbers.get("P.clusters", 0),
        refused=numbers.get("P.refused", 0),
        restored_clusters=numbers.get("P.restoration.clusters", 0),
        reference_points=REFERENCE_POINTS,
        aspect_step=ASPECT_EDGES[1],
    )


TEMPLATE = """\
# Results on the paper grid P

Generated by `python -m shipshape_lab.experiments.report` from the files that the commands at the end leave; do
not edit. Bundle `{bundle}` (manifest sha256 `{digest}`), quantised and calibrated with seed
{seed} at commit `{commit}`; the answers were computed by the code of commit `{code}`. Timings: {machine}.

P: 5 catalogue vessels x 9 distances (30 to 110 m) x 360 headings, one 64-channel LiDAR, calm sea; its hulls are
variations that no model saw, and training keeps its distances 0.5 m and its headings 0.1 deg off those of the
grid. Computed here: {clusters} clusters{subsample}, of which the service refuses {refused} (too few points);
refused clusters count as wrong in every share. The sensor's height above the water was {height}, so the lowest
point stands in for the waterline unless a table says otherwise.

## Targets

{targets}

"Clearly better" is taken as a CD-L1 of at most 0.8 of the mirrored cloud's, mirrored about the centre plane that
`best` itself estimates.

## Known weaknesses

{weaknesses}

## Which vessel

Share of clusters whose most probable vessel is the right one, %. In *(italics)*: what the paper's text gives for
the same column, on its own hulls and simulator; its 0 and 180 degrees stand beside our bow-on (aspect up to
15 deg) and stern-on (from 165 deg). `raw_spd2` classifies the raw cluster; `full_top`, `full_side`, `z_top` and
`z_side` are preset `paper` with each image method; `best` is the default.

{accuracy}

{accuracy_figure}

{accuracy_by_distance}

{accuracy_by_aspect}

{accuracy_by_vessel}

## How sure

Expected calibration error over 15 equal bins of the probability that is reported with the vessel. Everything in P
is in the catalogue, so every "unknown" is an error; the paper's method has no "unknown".

{confidence}{height_told}

## Heading, bow and stern, box

Heading error modulo pi; within 5 and 10 deg and "bow right" (the bow within 90 deg of the truth) in %. Preset
`paper` has one pose for its four image methods; the paper states 98.03 % orientation accuracy without a
tolerance.

{pose}

{heading_figure}

{box}

## Restoration

{restored_clusters} clusters (every {restoration_every}th of P) against 16,384 points of the complete outer
surface above the water, in the level frame, so that an error of the pose counts. d is the distance to the nearest
neighbour after scaling so that the **complete** surface's largest extent is 1. CD-L1 = (mean_P d + mean_G d) / 2;
CD-L2 = mean_P d^2 + mean_G d^2; F-score@1% = harmonic mean of the shares with d < 0.01. Clouds are compared as
they are, with as many points as they have. `mirrored` is the raw cluster and its reflection about the centre
plane that `best` estimates, `mirrored_true_pose` about the true one; `surface` is what {reference_points} other
points of the true surface would score, the level that a perfect cloud of about that size reaches.

{restoration}

{restoration_figure}

{restoration_by_distance}

{restoration_by_aspect}

{gallery_figure}

## Milliseconds

`best`, in process, one thread on one core, median of {runs} runs after warm-up; {machine}. Elapsed
time counts; where it is well above the processor time, other programs were running.

{latency}

## Commands

```
python -m shipshape_lab.simulator.datasets P --out runs/data
python -m shipshape_lab.experiments.evaluate_p --data runs/data --bundle models --out runs/results
python -m shipshape_lab.experiments.evaluate_p --data runs/data --bundle models --out runs/results --sensor-height
python -m shipshape_lab.experiments.restoration_p --data runs/data --bundle models --out runs/results
python -m shipshape_lab.experiments.gallery --data runs/data --bundle models --out docs/figures
python benchmarks/pipeline.py --bundle models --out runs/results
python -m shipshape_lab.experiments.report --results runs/results --out docs
```
"""
