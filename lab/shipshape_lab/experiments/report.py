"""Write docs/results.json, docs/results.md and its plots from what the experiments left.

    python -m shipshape_lab.experiments.report --results runs/results --out docs

The same results give the same files, byte for byte. What was not run is left out and said to be not measured.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from shipshape_lab.experiments import figures, markdown, numbers, predictions

SETS = ("P", "P_height_told")


def collect(results: Path) -> tuple[numbers.Numbers, dict]:
    """All numbers, and what they were computed with.

    Raises:
        ValueError: the main set is missing, or files belong to different bundles.
    """
    if not (results / "P.npz").exists():
        raise ValueError(f"expected P.npz in {results}, got none: run evaluate_p first")
    about = _read_json(results / "P.json")
    found: numbers.Numbers = {}
    for name in SETS:
        if (results / f"{name}.npz").exists():
            _check_bundle(results / f"{name}.json", about)
            truth, answers = predictions.load(results / f"{name}.npz")
            _check_done(name, answers)
            found |= numbers.of_answers(name, truth, answers, about["catalogue"])
    if (results / "restoration.npz").exists():
        about["restoration_every"] = _check_bundle(results / "restoration.json", about)["every"]
        with np.load(results / "restoration.npz") as arrays:
            found |= numbers.of_restoration(arrays["scores"], arrays["range_m"], arrays["aspect_deg"])
    if (results / "pipeline_ms.json").exists():
        timing = _check_bundle(results / "pipeline_ms.json", about)
        found |= numbers.of_pipeline_ms(timing)
        about["timing"] = timing
    return numbers.rounded(found), about


def _read_json(path: Path) -> dict:
    return json.loads(path.read_text())


def _check_bundle(path: Path, about: dict) -> dict:
    other = _read_json(path)
    if other["bundle_digest"] != about["bundle_digest"]:
        raise ValueError(
            f"expected {path.name} of bundle {about['bundle_digest'][:12]} as P.json, "
            f"got {other['bundle_digest'][:12]}: run it again"
        )
    return other


def _check_done(name: str, answers: predictions.Answers) -> None:
    done = int(answers.done.sum())
    if done < len(answers.done):
        raise ValueError(f"expected all {len(answers.done)} clusters of {name}, got {done}: run it to its end")


def texts(about: dict) -> dict:
    """What the page says beside the numbers."""
    timing = about.get("timing", {})
    sizes = sorted(timing.get("points", {}), key=int)
    return {
        "bundle": about["bundle"],
        "digest": about["bundle_digest"][:16],
        "commit": str(about["training"].get("commit", "unknown")),
        "code": str(about.get("code", "unknown")),
        "seed": about["training"].get("seed", "unknown"),
        "machine": machine_text(timing),
        "height": about["sensor_height"],
        "subsample": "" if about["every"] == 1 else f" (every {about['every']}th)",
        "catalogue": about["catalogue"],
        "restoration_every": about.get("restoration_every", "-"),
        "runs": timing.get("runs", 0),
        "sizes": sizes,
        "stages": timing.get("stages", []),
    }


def machine_text(timing: dict) -> str:
    """The machine of the timings in words."""
    if "machine" not in timing:
        return "not measured"
    machine = timing["machine"]
    return f"{machine['processor']}, {machine['cores']} cores, {machine['system']}"


def write(results: Path, out: Path) -> None:
    """Write the three kinds of files."""
    found, about = collect(results)
    words = texts(about)
    provenance = {
        "seed": words["seed"],
        "commit": words["commit"],
        "code": words["code"],
        "machine": words["machine"],
        "bundle_digest": about["bundle_digest"],
        "restoration.every": words["restoration_every"],
        "P.every": about["every"],
    }
    out.mkdir(parents=True, exist_ok=True)
    content = json.dumps({**found, **provenance}, indent=1, sort_keys=True)
    (out / "results.json").write_text(content + "\n")
    drawn = figures.draw_all(found, out / "figures")
    if (out / "figures/gallery.png").exists():
        drawn.append("gallery.png")
    (out / "results.md").write_text(markdown.page(found, words, drawn))


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
