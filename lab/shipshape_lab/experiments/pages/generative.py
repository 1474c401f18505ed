"""Section: the generative restorer beside the deterministic one."""

from shipshape_lab.experiments.markdown import figure, percent, plain, table
from shipshape_lab.experiments.numbers import Numbers

TITLE = "A generative restorer"
COMMAND = """\
python -m shipshape_lab.generative.train --data runs/data --out runs/generative
for steps in 1 2 4 8; do
  python -m shipshape_lab.generative.bundle --base models --flow runs/generative/flow_$steps.onnx \\
    --data runs/data --to runs/generative/bundle_$steps
done
python -m shipshape_lab.experiments.generative --data runs/data --flows runs/generative --out runs/results"""
DETERMINISTIC = "deterministic"
FLOWS = ("flow_1", "flow_2", "flow_4", "flow_8")
_ROWS = {
    DETERMINISTIC: "deterministic (`best`, int8)",
    **{flow: f"flow, {flow.removeprefix('flow_')} step{'' if flow == 'flow_1' else 's'}" for flow in FLOWS},
}
SETS = ("P", "H")
# What is compared: how it is called, its key, and whether more of it is better.
_MEASURES = (
    ("CD-L1", "cd_l1", False),
    ("CD-L2", "cd_l2", False),
    ("F-score@1%", "fscore", True),
    ("accuracy", "accuracy", True),
    ("Brier score of the cells", "brier", False),
    ("rank correlation of doubt", "doubt_rank", True),
)


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    flow = about["flow"]
    tables = [_quality(numbers, name) for name in SETS]
    return "\n\n".join(
        [
            INTRODUCTION.format(
                seed=flow["noise_seed"],
                calibrated="calibrated again" if flow["calibrated_again"] else "with the base's calibration",
            ),
            *tables,
            TIMES.format(turns=about["turns"], machine=about["machine"], base=_ms(numbers, DETERMINISTIC)),
            figure("generative.png", "measured, deterministic, three samples, truth"),
            SPREAD.format(P=numbers["P.generative.clusters_drawn"], H=numbers["H.generative.clusters_drawn"]),
            _spread(numbers),
            _verdict(numbers),
        ]
    )


INTRODUCTION = """\
The paper names generative restoration as future work. Ours is a rectified flow on the aligned layers of preset
`best`: a network of 0.8 M parameters is given what the deterministic one is given, and noise, and walks in 1, 2,
4 or 8 Euler steps to occupancy, top, bottom and offset. It is trained on the same clusters in the same disturbed
poses. Each row is a whole bundle that the service runs unchanged: the default one with the flow for
`inpainting.onnx`, its steps unrolled, its noise drawn once (seed {seed}) and kept in the file, {calibrated}. Two
things favour the deterministic network: it is trained for more passes over the data, and the SPD2 classifier was
trained on what it restores. Clusters and scores are those of the sections on restoration; *lead* is by how much
CD-L1 is better than the deterministic one's, paired, with its standard error. Accuracy is that of these clusters
only: on P the most probable vessel, on H the decision, which may be "unknown"."""

TIMES = """\
*ms* is the time from the pose to the restored cloud on P, one thread, median of {turns} clusters on {machine},
counted as in the section on restoration time; the deterministic network ({base} ms) is int8 and the flow is
float32, since rounding would have to be learnt for each number of steps."""

SPREAD = """\
Eight vessels drawn with other noise for each of {P} clusters of P and {H} of H. *A sample* is the mean CD-L1 of
one, *best of 8* that of the one nearest to the truth, which nobody knows at sea. *Brier* is the mean squared
error of the samples' mean occupancy, as a probability, over the cells that were not measured; the deterministic
network's own occupancy is held to the same. *Doubt* is sum p (1 - p) / sum p over these cells; its rank
correlation (Spearman) with CD-L1 says whether the restorer knows which of its restorations are bad."""


def _ms(numbers: Numbers, system: str) -> str:
    return plain(numbers, f"P.restore_ms.{system}")


def _quality(numbers: Numbers, name: str) -> str:
    rows = [
        (
            title,
            plain(numbers, f"{name}.cd_l1.{system}"),
            _lead(numbers, name, system),
            plain(numbers, f"{name}.cd_l2.{system}", 3),
            plain(numbers, f"{name}.fscore.{system}", 3),
            percent(numbers, f"{name}.accuracy.{system}"),
            _ms(numbers, system) if name == "P" else "",
        )
        for system, title in _ROWS.items()
    ]
    head = f"{name}, {numbers[f'{name}.generative.clusters']} clusters"
    return table((head, "CD-L1 x 1000", "lead", "CD-L2 x 1000", "F-score@1%", "accuracy, %", "ms"), rows)


def _lead(numbers: Numbers, name: str, system: str) -> str:
    if system == DETERMINISTIC:
        return ""
    lead, error = (numbers[f"{name}.cd_l1_{what}.{system}"] for what in ("lead", "lead_error"))
    return f"{lead:+.2f} ({error:.2f})"


def _spread(numbers: Numbers) -> str:
    columns = (("cd_l1_sample", 2), ("cd_l1_best_sample", 2), ("brier", 4), ("doubt_rank", 2))
    rows = [
        (title, *(plain(numbers, f"{name}.{what}.{system}", digits) for name in SETS for what, digits in columns))
        for system, title in _ROWS.items()
    ]
    spoken = ("a sample", "best of 8", "Brier", "doubt")
    return table(("CD-L1 x 1000", *(f"{name}, {what}" for name in SETS for what in spoken)), rows)


def _verdict(numbers: Numbers) -> str:
    """With how many steps the flow is ahead of the deterministic restorer, measure by measure."""
    rows = [
        (title, *(_ahead(numbers, f"{name}.{what}", more=more) for name in SETS))
        for title, what, more in _MEASURES
    ]
    return "\n\n".join(
        [
            table(("steps with which the flow is ahead", *SETS), rows),
            CLOSE.format(
                one=_ms(numbers, "flow_1"), four=_ms(numbers, "flow_4"), base=_ms(numbers, DETERMINISTIC)
            ),
        ]
    )


def _ahead(numbers: Numbers, key: str, *, more: bool) -> str:
    base = numbers[f"{key}.{DETERMINISTIC}"]
    leads = {flow: (numbers[f"{key}.{flow}"] - base) * (1 if more else -1) for flow in FLOWS}
    return ", ".join(flow.removeprefix("flow_") for flow, lead in leads.items() if lead > 0) or "none"


CLOSE = """\
Where no steps stand, the deterministic restorer is at least as good; the tables say by how much, and a few
clusters more or fewer named right are chance. It takes {base} ms, one step of the flow {one} ms, four steps
{four} ms. So it stays the default and no flow is shipped; the commands below make the bundle, for whoever wants
what the flow is ahead in, or several plausible vessels instead of one."""
