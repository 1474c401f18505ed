"""Deck gear shared by many types: rails, masts, radars, antennas, crew, winches, fenders, outboards."""

import numpy as np

from shipshape_lab.simulator.vessels.parts import ball, block, cone, rod, rods
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined


def rail(path: np.ndarray, height: float, *, wires: int = 2, radius: float = 0.02) -> Shape:
    """Stanchions at every point of a path (n, 3) and `wires` bars between them, the highest at `height` m."""
    up = np.array([0.0, 0.0, height])
    segments = [np.stack([path, path + up], axis=1)]
    for wire in range(1, wires + 1):
        line = path + up * wire / wires
        segments.append(np.stack([line[:-1], line[1:]], axis=1))
    return rods(np.concatenate(segments), radius)


def rails(path: np.ndarray, height: float, *, wires: int = 2) -> Shape:
    """The rail along a port-side path and its twin to starboard."""
    return both_sides(rail(path, height, wires=wires))


def pole_mast(height: float, *, foot: float = 0.09, spread: float = 0.0) -> Shape:
    """A tapered mast on z = 0 with one cross-tree of `spread` metres each side at three quarters height."""
    parts = [cone(foot, foot * 0.5, height, sides=6)]
    if spread > 0:
        z = 0.75 * height
        parts.append(rod((0.0, -spread, z), (0.0, spread, z), 0.03))
        parts += [both_sides(rod((0.0, spread, z), (0.0, spread, z + 0.25), 0.05))]
    return joined(parts)


def lattice_mast(height: float, *, stance: float = 0.5, lean: float = 0.3) -> Shape:
    """Four legs that close towards a platform `lean` metres abaft, with braces and a cross-tree."""
    foot = stance * np.array([[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]])
    low = np.column_stack([foot, np.zeros(4)])
    high = np.column_stack([foot * 0.4 - [lean, 0.0], np.full(4, height * 0.8)])
    middle = (low + high) / 2
    legs = np.stack([low, high], axis=1)
    braces = np.stack([low, np.roll(middle, 1, axis=0)], axis=1)
    belts = np.stack([middle, np.roll(middle, 1, axis=0)], axis=1)
    top = block(0.5 * stance, 0.7 * stance, 0.06).moved(x=-lean, z=height * 0.8)
    pole = rod((-lean, 0.0, height * 0.8), (-lean, 0.0, height), 0.03)
    yard = rod((-lean, -stance, height * 0.85), (-lean, stance, height * 0.85), 0.03)
    return joined([rods(np.concatenate([legs, braces, belts]), 0.035), top, pole, yard])


def arch_mast(width: float, height: float, *, lean: float = 0.4) -> Shape:
    """Two legs `width` metres apart and a beam across them `lean` metres abaft of their feet."""
    leg = rod((0.0, width / 2, 0.0), (-lean, width * 0.4, height), 0.06)
    beam = block(0.35, width * 0.86, 0.1).moved(x=-lean, z=height)
    return joined([both_sides(leg), beam])


def open_radar(span: float) -> Shape:
    """An open-array radar: pedestal and a scanner bar `span` metres long, on z = 0."""
    return joined([cone(0.16, 0.13, 0.25, sides=8), block(0.12, span, 0.12).turned(0.5).moved(z=0.25)])


def dome(radius: float) -> Shape:
    """A closed radar or satellite dome on z = 0."""
    return joined([cone(radius * 0.6, radius * 0.6, 0.1, sides=8), ball(radius).moved(z=radius)])


def whip(height: float, *, lean: float = 0.1) -> Shape:
    """A whip antenna on z = 0, its tip `lean` times its height abaft."""
    return rod((0.0, 0.0, 0.0), (-lean * height, 0.0, height), 0.015, 4)


def seated(height: float = 1.35) -> Shape:
    """A person on a seat: legs forward, trunk, head; the seat's foot on z = 0, facing the bow."""
    trunk = block(0.26, 0.46, 0.6, chamfer=0.04).moved(z=height - 0.85)
    thighs = block(0.5, 0.4, 0.16).moved(x=0.25, z=height - 0.85)
    shins = block(0.14, 0.36, height - 0.85).moved(x=0.45)
    head = ball(0.12, stretch=1.2).moved(z=height - 0.12)
    return joined([trunk, thighs, shins, head])


def standing(height: float = 1.75) -> Shape:
    """A person standing on z = 0."""
    legs = block(0.22, 0.34, 0.48 * height)
    trunk = block(0.26, 0.48, 0.36 * height, chamfer=0.03).moved(z=0.48 * height)
    return joined([legs, trunk, ball(0.12, stretch=1.2).moved(z=height - 0.14)])


def winch(width: float, radius: float) -> Shape:
    """A drum across the deck between two cheeks, on z = 0."""
    drum = rod((0.0, -width / 2, radius), (0.0, width / 2, radius), radius * 0.75, 10)
    cheek = rod((0.0, width / 2, radius), (0.0, width / 2 + 0.08, radius), radius, 10)
    bed = block(1.6 * radius, width + 0.2, radius * 0.4)
    return joined([drum, both_sides(cheek), bed])


def bitts(height: float, width: float) -> Shape:
    """Two posts and the bar across them, on z = 0."""
    post = cone(0.1, 0.1, height, sides=8).moved(y=width / 2)
    bar = rod((0.0, -width * 0.75, height * 0.7), (0.0, width * 0.75, height * 0.7), 0.08)
    return joined([both_sides(post), bar])


def tyre(radius: float = 0.4) -> Shape:
    """A tyre fender hung flat against the port side, its middle at the origin."""
    return rod((0.0, -0.02, 0.0), (0.0, 0.22, 0.0), radius, 10)


def tyres(points: np.ndarray, radius: float) -> Shape:
    """Tyre fenders on both sides, at port points (n, 3)."""
    return both_sides(joined([tyre(radius).moved(x=x, y=y, z=z) for x, y, z in points]))


def outboard(height: float = 1.3) -> Shape:
    """An outboard engine: cowling over a leg, clamped at the origin, its leg reaching below."""
    cowl = block(0.6, 0.42, 0.45 * height, chamfer=0.08).moved(x=-0.3, z=0.1)
    leg = block(0.22, 0.16, 0.9).moved(x=-0.3, z=-0.8)
    return joined([cowl, leg])


def raft_canister(radius: float = 0.3) -> Shape:
    """A life-raft canister lying along the vessel, on z = 0."""
    barrel = rod((-0.6, 0.0, radius), (0.6, 0.0, radius), radius, 10)
    return joined([barrel, block(0.8, 1.6 * radius, radius * 0.5)])


def stack(height: float, *, length: float, width: float) -> Shape:
    """A funnel casing with a pipe out of its top, on z = 0."""
    pipe = rod((-0.1, 0.0, height), (-0.2, 0.0, height + 0.35), 0.22 * width, 8)
    return joined([block(length, width, height, chamfer=0.12 * width), pipe])
