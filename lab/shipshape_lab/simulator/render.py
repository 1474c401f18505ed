"""A contact sheet of ray-cast vessels with Lambert shading: generated types, real meshes beside them.

python -m shipshape_lab.simulator.render --out out/vessels.png --real path/to/meshes
"""

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import matplotlib
import numpy as np
import trimesh
from matplotlib.figure import Figure
from trimesh.ray.ray_pyembree import RayMeshIntersector

from shipshape_lab.simulator.vessels import VESSEL_TYPES, build_vessel
from shipshape_lab.simulator.vessels.shape import Shape, above_water

matplotlib.use("Agg")

VIEWPOINTS = (
    (-55.0, 14.0),
    (-140.0, 28.0),
)  # azimuth from the bow, counter-clockwise, and elevation, degrees
_SUN = np.array([0.35, -0.55, 0.75]) / np.linalg.norm([0.35, -0.55, 0.75])


def render(mesh: trimesh.Trimesh, azimuth_deg: float, elevation_deg: float, *, width: int = 480) -> np.ndarray:
    """Parallel-projection picture of a mesh in the vessel frame.

    Args:
        mesh: metres, vessel frame.
        azimuth_deg: where the eye stands, counter-clockwise from the bow.
        elevation_deg: how high the eye stands above the horizon.
        width: pixels; the height is two thirds of it.

    Returns:
        Grey picture (height, width), 0 to 1, white where no ray hits.
    """
    eye, right, up = _camera(np.deg2rad(azimuth_deg), np.deg2rad(elevation_deg))
    centre, scale = _frame(mesh.vertices, right, up, width)
    u, v = np.meshgrid(np.arange(width) - width / 2, width / 3 - np.arange(width * 2 // 3))
    far = centre + eye * 4.0 * mesh.extents.max()
    origins = far + scale * (u.ravel()[:, None] * right + v.ravel()[:, None] * up)
    hit = RayMeshIntersector(mesh).intersects_first(origins, np.broadcast_to(-eye, origins.shape))
    normals = mesh.face_normals[hit]
    normals = normals * np.sign(normals @ eye)[:, None]  # meshes from elsewhere do not all face outwards
    shade = 0.3 + 0.35 * np.clip(normals @ _SUN, 0.0, 1.0) + 0.3 * np.clip(normals @ eye, 0.0, 1.0)
    return np.where(hit >= 0, shade, 1.0).reshape(u.shape)


def contact_sheet(meshes: Iterable[tuple[str, trimesh.Trimesh]], out: Path, *, width: int = 480) -> None:
    """Write a PNG with one row per mesh and one picture per viewpoint, two meshes abreast."""
    meshes = list(meshes)
    rows = -(-len(meshes) // 2)
    figure = Figure(figsize=(4 * width / 100, rows * width / 150), dpi=100)
    axes = figure.subplots(rows, 4, squeeze=False).reshape(-1, 2)
    for axis in axes.ravel():
        axis.axis("off")
    for pair, (title, mesh) in zip(axes, meshes, strict=False):
        for axis, viewpoint in zip(pair, VIEWPOINTS, strict=True):
            axis.imshow(render(mesh, *viewpoint, width=width), cmap="gray", vmin=0, vmax=1)
        pair[0].set_title(
            f"{title}  {' x '.join(f'{side:.1f}' for side in mesh.extents)} m", loc="left", fontsize=9
        )
    figure.subplots_adjust(0, 0, 1, 0.98, 0.0, 0.06)
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out)


def main(argv: Sequence[str] | None = None) -> int:
    """Command line: render every vessel type, and the real meshes of a folder if one is given."""
    options = _parser().parse_args(argv)
    names = [(name, seed) for name in VESSEL_TYPES for seed in (None, *range(options.sisters))]
    meshes = [(name if seed is None else f"{name} #{seed}", build_vessel(name, seed).mesh) for name, seed in names]
    meshes += _real_meshes(options.real)
    contact_sheet(meshes, options.out, width=options.width)
    sys.stdout.write(f"Wrote {len(meshes)} vessels to {options.out}.\n")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m shipshape_lab.simulator.render",
        description="Render a contact sheet of the generated vessel types, beside real meshes if given.",
        epilog="example: python -m shipshape_lab.simulator.render --out out/vessels.png --real meshes/",
    )
    parser.add_argument("--out", type=Path, required=True, help="PNG file to write")
    parser.add_argument("--real", type=Path, help="folder of real meshes (.ply, metres, vessel frame)")
    parser.add_argument("--sisters", type=int, default=0, help="varied hulls to show after each nominal one")
    parser.add_argument("--width", type=int, default=480, help="width of one picture in pixels")
    return parser


def _real_meshes(folder: Path | None) -> list[tuple[str, trimesh.Trimesh]]:
    """Every .ply of a folder, cut at the waterline."""
    if folder is None:
        return []
    paths = sorted(folder.glob("*.ply"))
    if not paths:
        sys.stderr.write(f"No .ply meshes in {folder}: rendering the generated vessels only.\n")
    return [(f"real: {path.stem}", _cut(trimesh.load(path, force="mesh", process=False))) for path in paths]


def _cut(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The part of a mesh above the waterline, so that the sizes shown compare with the generated hulls."""
    dry = above_water(Shape(np.asarray(mesh.vertices), np.asarray(mesh.faces)))
    return trimesh.Trimesh(dry.vertices, dry.faces, process=False)


def _camera(azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors towards the eye, to the right and up, for an eye at these angles in radians."""
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    eye = np.array([np.cos(elevation) * cos, np.cos(elevation) * sin, np.sin(elevation)])
    right = np.array([-sin, cos, 0.0])
    return eye, right, np.cross(eye, right)


def _frame(vertices: np.ndarray, right: np.ndarray, up: np.ndarray, width: int) -> tuple[np.ndarray, float]:
    """Middle of the view in space and metres per pixel, so that the whole mesh fits with a margin."""
    u, v = vertices @ right, vertices @ up
    spans = np.array([np.ptp(u) / width, np.ptp(v) / (width * 2 / 3)])
    centre = right * (u.min() + u.max()) / 2 + up * (v.min() + v.max()) / 2
    return centre, float(spans.max() * 1.08)


if __name__ == "__main__":
    raise SystemExit(main())
