"""Section: what no model was trained on, against the catalogue."""

from shipshape_lab.experiments.markdown import asked, percent, plain, spoken, table
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.rejection import GROUPS, KIN

TITLE = "Unknown: things and vessels that no model was trained on"
COMMAND = """\
python -m shipshape_lab.simulator.datasets U --meshes MESHES --out runs/data
python -m shipshape_lab.experiments.evaluate --set U --data runs/data --peers runs/peers --out runs/results"""


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    systems = asked(numbers, "U.auroc.")
    ends = {"": "all", ".generated": "generated", ".real": "real hulls"}
    whole = [
        (
            f"`{s}`",
            *(plain(numbers, f"U.auroc.{s}{end}", 4) for end in ends),
            *(percent(numbers, f"U.called_unknown.{s}{end}") for end in ends),
            percent(numbers, f"P.unknown_share.{s}"),
        )
        for s in systems
    ]
    head = [f"{what}, {part}" for what in ("AUROC", "called unknown, %") for part in ends.values()]
    return "\n\n".join(
        [
            INTRODUCTION.format(clusters=numbers["U.clusters"], refused=numbers["U.refused"]),
            table(("system", *head, "P called unknown, %"), whole),
            table(
                ("kind", "AUROC, `best`", *(f"called unknown, %, `{s}`" for s in systems)),
                _kinds(numbers, systems),
            ),
            *_kin(numbers, systems),
        ]
    )


INTRODUCTION = """\
{clusters} clusters ({refused} refused) of generated things (buoys, dolphins, quays, jetties, container barges,
rocks, pontoons, monopiles, lattice towers; `lab/shipshape_lab/simulator/outsiders.py`) and of real hulls from mesh
files, scanned as P is and at its ranges, so that U and P differ by what is scanned alone. AUROC: the chance that a
cluster of U is given a higher probability of "unknown" than a cluster of P.

Only the generated things are a test that nobody had seen. The real hulls are not: that whatever is longer than
1.25 times the catalogue's longest vessel is unknown was settled after a look at what the ships among them were
called, and the simulated types were drawn with pictures of these hulls beside them. So the two are given apart.
Training knows "unknown" from vessels outside of the catalogue and from strangers, which are stretched hulls and
heaps of simple solids; the generated things are none of those, but some are made of simple solids too."""


def _kinds(numbers: Numbers, systems: list[str]) -> list[tuple[str, ...]]:
    prefix = "U.auroc.best."
    kinds = {key.removeprefix(prefix) for key in numbers if key.startswith(prefix)} - set(GROUPS)
    return [
        (
            spoken(kind),
            plain(numbers, prefix + kind, 4),
            *(percent(numbers, f"U.called_unknown.{s}.{kind}") for s in systems),
        )
        for kind in sorted(kinds, key=lambda kind: (numbers[prefix + kind], kind))
    ]


def _kin(numbers: Numbers, systems: list[str]) -> list[str]:
    hulls = [hull for hull in KIN if f"U.kin.best.{hull}.called_unknown" in numbers]
    if not hulls:
        return []
    shares = ("called_its_type", "called_unknown")
    rows = [
        (
            f"{hull} ({spoken(KIN[hull])})",
            *(percent(numbers, f"U.kin.{s}.{hull}.{what}") for s in systems for what in shares),
        )
        for hull in hulls
    ]
    head = [f"{spoken(what)}, `{s}`" for s in systems for what in shares]
    return [KIN_TEXT, table(("real hull, %", *head), rows)]


KIN_TEXT = """\
Real hulls of a type that the catalogue has are neither known nor unknown: another hull than any of the catalogue,
but a vessel of its kind. They have no part in the numbers above."""
