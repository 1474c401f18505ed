"""The rounds of a run -> flat numbers: medians, and beside them the least and the greatest of the rounds."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median

Numbers = Mapping[str, float]
Flat = dict[str, float | str]

OURS = "rest_binary"  # the door whose numbers stand for the service where only one is asked for
FAILED = "failed"  # in a round: why there are no numbers
KEPT_BY_SERVER = ("efficiency", "throughput_over_limit", "p99_over_p50", "rss_mb", "ready_s")
EXTRA = ("throughput", "cpu_ms", "limit_cpu_ms", "p50_ms", "p99_ms", "lag_ms")
TARGETS = {
    "efficiency.rest_binary": (">=", 0.92),
    "efficiency.grpc_unary": (">=", 0.85),
    "efficiency.grpc_stream": (">=", 0.90),
    "efficiency.grpc_scan8": (">=", 0.95),
    "efficiency.grpc_scan32": (">=", 0.97),
    "p99_over_p50.at_70pct": ("<=", 3.0),
    "goodput.at_2x": (">=", 0.90),
    "goodput.at_5x": (">=", 0.90),
    "accepted_p99_ms": ("<=", 50.0),
    "refusal_p99_ms": ("<=", 2.0),
    "scaling.1_to_2": (">=", 1.9),
    "ready_s": ("<=", 2.0),
    "rss_mb": ("<=", 300.0),
}


def read(run: Path) -> dict[str, list[dict]]:
    """What each server's files in a run folder say, one entry a round."""
    found: dict[str, list[dict]] = {}
    for file in sorted(run.glob("round-*/*.json")):
        found.setdefault(file.stem, []).append(json.loads(file.read_text()))
    return found


def flat(found: Mapping[str, Sequence[dict]]) -> Flat:
    """KEY.SERVER: the median of the rounds; least.* and most.*: their spread; failed.SERVER: why.

    Args:
        found: Of each server, what its rounds gave: numbers, or `failed` and the reason.
    """
    numbers: Flat = {}
    for server, rounds in found.items():
        good = [entry for entry in rounds if FAILED not in entry]
        if len(good) < len(rounds):
            numbers[f"{FAILED}.{server}"] = next(entry[FAILED] for entry in rounds if FAILED in entry)
        for key in good[0] if good else ():
            name = f"{key}.{server}" if key in KEPT_BY_SERVER + EXTRA else key
            values = [entry[key] for entry in good]
            numbers[name] = round(median(values), 4)
            numbers[f"least.{name}"], numbers[f"most.{name}"] = round(min(values), 4), round(max(values), 4)
    return numbers | _of_the_service(numbers)


def short_of_targets(numbers: Flat) -> list[str]:
    """One sentence for each target of the service that was missed or not measured."""
    sentences = []
    for key, (sense, bound) in TARGETS.items():
        value = numbers.get(key)
        if value is None:
            sentences.append(f"{key}: expected {sense} {bound:g}, not measured")
        elif (value < bound) if sense == ">=" else (value > bound):
            sentences.append(f"{key}: expected {sense} {bound:g}, got {value:.3g}")
    best = _best_peer(numbers)
    ours = numbers.get(f"efficiency.{OURS}")
    if best and ours is not None and numbers[f"efficiency.{best}"] >= ours:
        sentences.append(f"efficiency.{OURS}: expected to be ahead of every peer, got behind {best}")
    return sentences


def _of_the_service(numbers: Flat) -> Flat:
    """The keys that name no door."""
    aliases = {
        "p99_over_p50.at_70pct": f"p99_over_p50.{OURS}",
        "ready_s": f"ready_s.{OURS}",
        "rss_mb": f"rss_mb.{OURS}",
    }
    own = {alias: numbers[key] for alias, key in aliases.items() if key in numbers}
    for name in ("refusal_p99_ms", "accepted_p99_ms"):
        worst = [numbers[key] for key in (f"{name}.at_2x", f"{name}.at_5x") if key in numbers]
        own |= {name: max(worst)} if worst else {}
    return own


def _best_peer(numbers: Flat) -> str:
    peers = {
        key.removeprefix("efficiency."): value
        for key, value in numbers.items()
        if key.startswith("efficiency.") and not key.startswith(("efficiency.rest_", "efficiency.grpc_"))
    }
    return max(peers, key=peers.__getitem__, default="")
