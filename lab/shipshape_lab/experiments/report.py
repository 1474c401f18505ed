"""Write docs/results.json, docs/results.md and its plots from what the experiments left.

    python -m shipshape_lab.experiments.report --results runs/results --out docs

Every OUT/NAME.json with `numbers` and `about` is taken in; a section of its own comes from the module of its name
in `pages`. The same results give the same files, byte for byte. What was not run is left out and listed.
"""

import argparse
import importlib
import json
import pkgutil
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from shipshape_lab.experiments import figures, pages
from shipshape_lab.experiments.markdown import table
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.targets import TARGETS, bins_below
from shipshape_lab.experiments.weaknesses import weaknesses

MAIN = "recognition_p"  # the bundle of all others must be that of this one
ORDER = (
    "recognition_p",
    "recognition_far",
    "recognition_h",
    "recognition_u",
    "reasons",
    "ladder",
    "heading_peers",
    "restoration_p",
    "restoration_h",
    "restore_ms",
    "modelnet",
    "experiment_2",
    "ablation",
    "generative",
    "real_catalogue",
    "pipeline_ms",
)


@dataclass(frozen=True)
class Outcome:
    """What one experiment left: the stem of its file, its numbers, and what they were computed with."""

    name: str
    numbers: Numbers
    about: dict


def collect(results: Path) -> list[Outcome]:
    """What every experiment left, in the order of the page.

    Raises:
        ValueError: the main experiment is missing, or two of them are of different bundles or contradict.
    """
    if not (results / f"{MAIN}.json").exists():
        raise ValueError(f"expected {MAIN}.json in {results}, got none: run evaluate --set P first")
    found = [_read(path) for path in sorted(results.glob("*.json"))]
    found.sort(key=lambda one: ORDER.index(one.name) if one.name in ORDER else len(ORDER))
    _check_bundle(found)
    return found


def _read(path: Path) -> Outcome:
    content = json.loads(path.read_text())
    if set(content) != {"about", "numbers"}:
        raise ValueError(f"expected {path} to hold about and numbers, got {', '.join(sorted(content))}")
    return Outcome(path.stem, content["numbers"], content["about"])


def _check_bundle(found: list[Outcome]) -> None:
    digests = {one.name: one.about["bundle_digest"][:12] for one in found if "bundle_digest" in one.about}
    for name, digest in digests.items():
        if digest != digests[MAIN]:
            raise ValueError(
                f"expected {name}.json of bundle {digests[MAIN]} as {MAIN}.json, got {digest}: run it again"
            )


def merged(found: list[Outcome]) -> Numbers:
    """All numbers in one.

    Raises:
        ValueError: two experiments give different values to one key.
    """
    whole: Numbers = {}
    for one in found:
        for key, value in one.numbers.items():
            if whole.setdefault(key, value) != value:
                raise ValueError(f"expected one value of {key}, got {whole[key]} and {value} in {one.name}.json")
    return whole


def page(found: list[Outcome]) -> str:
    """The whole of docs/results.md."""
    whole, by_name = merged(found), {one.name: one for one in found}
    about = by_name[MAIN].about
    sections = _sections()
    parts = [HEAD.format(**_provenance(found)), _targets(whole), "## What does not work"]
    parts.append("\n".join(f"- {sentence}" for sentence in weaknesses(whole, about["catalogue"])))
    for name, module in sections.items():
        if name in by_name:
            text = module.section(whole, by_name[name].about)
            parts.append(f"## {module.TITLE}\n\n{text}\n\n```\n{module.COMMAND}\n```")
    missing = [f"- {module.TITLE}: `{name}`" for name, module in sections.items() if name not in by_name]
    if missing:
        parts.append("## Not measured\n\n" + "\n".join(missing))
    parts.append(f"## This page\n\n```\n{COMMAND}\n```")
    return "\n\n".join(parts) + "\n"


def _sections() -> dict[str, ModuleType]:
    names = [module.name for module in pkgutil.iter_modules(pages.__path__)]
    names.sort(key=lambda name: ORDER.index(name) if name in ORDER else len(ORDER))
    return {name: importlib.import_module(f"{pages.__name__}.{name}") for name in names}


def _targets(whole: Numbers) -> str:
    rows = [(target.text, target.wanted, *target.verdict(whole)) for target in TARGETS]
    text = f"## Targets\n\n{table(('target', 'wanted', 'measured', 'verdict'), rows)}"
    try:
        below = ", ".join(f"{part} ({rival})" for part, rival in bins_below(whole))
    except KeyError:
        return text
    return f"{text}\n\nBins of P where a rival is ahead of `best`: {below or 'none'}."


def _provenance(found: list[Outcome]) -> dict[str, str]:
    about = next(one.about for one in found if one.name == MAIN)
    timing = next((one.about for one in found if one.name == "pipeline_ms"), {})
    machine = timing.get("machine")
    return {
        "bundle": about["bundle"],
        "bundle_digest": about["bundle_digest"],
        "seed": str(about["training"].get("seed", "unknown")),
        "commit": str(about["training"].get("commit", "unknown")),
        "code": ", ".join(sorted({str(one.about["code"]) for one in found if "code" in one.about})),
        "machine": "{processor}, {cores} cores, {system}".format(**machine) if machine else "not measured",
    }


HEAD = """\
# Results

Generated by `python -m shipshape_lab.experiments.report` from the files that the commands below each section
leave; do not edit. All numbers are in `results.json`. Bundle `{bundle}` (manifest sha256 `{bundle_digest:.16}`),
quantised and calibrated with seed {seed} at commit `{commit}`; the answers were computed by the code of
{code}. Timings: {machine}.

The sets: P is the paper's grid, far its vessels farther off, H the hard test, M shapes of ModelNet40, R real
meshes as a catalogue, U what no model was trained on. Hulls, headings, distances, noise and occluders of the test
sets are never seen in training; a test of the lab asserts it. Calibration, thresholds, temperatures and all other
choices that a section names were made on the validation set. One choice was not: the section on U says which."""

COMMAND = "python -m shipshape_lab.experiments.report --results runs/results --out docs"


def write(results: Path, out: Path) -> None:
    """Write the three kinds of files."""
    found = collect(results)
    out.mkdir(parents=True, exist_ok=True)
    content = json.dumps({**merged(found), **_provenance(found)}, indent=1, sort_keys=True)
    (out / "results.json").write_text(content + "\n")
    figures.draw_all(merged(found), out / "figures")
    (out / "results.md").write_text(page(found))


def main(argv: list[str] | None = None) -> None:
    """Command line: collects and writes."""
    args = _parser().parse_args(argv)
    try:
        write(args.results, args.out)
    except ValueError as error:
        raise SystemExit(f"report: {error}") from error
    print(f"wrote {args.out / 'results.json'}, {args.out / 'results.md'} and {args.out / 'figures'}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m shipshape_lab.experiments.report",
        description="Writes results.json, results.md and the plots from a folder of results.",
        epilog="example: python -m shipshape_lab.experiments.report --results runs/results --out docs",
    )
    parser.add_argument("--results", type=Path, required=True, help="folder that the experiments wrote to")
    parser.add_argument("--out", type=Path, default=Path("docs"), help="folder of the documents (default docs)")
    return parser


if __name__ == "__main__":
    main()
