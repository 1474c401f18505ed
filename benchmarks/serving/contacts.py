"""The contacts that are asked about: the sample contacts that travel with the examples, thinned to one size."""

from pathlib import Path

import numpy as np

CONTACTS = Path("examples/contacts.npz")
POINTS = 300
COUNT = 16


def contacts(seed: int) -> list[np.ndarray]:
    """`COUNT` clusters (n, 3), float32, metres, level frame: of `POINTS` points, or all that a sample has."""
    sample = np.load(CONTACTS, allow_pickle=False)
    clusters = np.split(sample["points"].astype(np.float32), np.cumsum(sample["n"])[:-1])
    largest = sorted(clusters, key=len, reverse=True)
    rng = np.random.default_rng(seed)
    return [_thinned(largest[index % len(largest)], rng) for index in range(COUNT)]


def _thinned(cluster: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    kept = rng.choice(len(cluster), min(POINTS, len(cluster)), replace=False)
    return np.round(cluster[np.sort(kept)], 3)  # to the millimetre, so that JSON can be short and yet the same
