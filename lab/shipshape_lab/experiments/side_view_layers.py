"""What should the layers of a side view divide? The paper does not say; this measures what each choice can hold.

    python -m shipshape_lab.experiments.side_view_layers

A complete surface is projected and lifted back, nothing inpainted: what is lost then, no network can restore.
Candidates, for the 64 x 64 side views: layers that divide the height (one y for each cell, since a row belongs to
one layer), the lateral extent of the normalised cube, or the beam. CD-L1 x 1000, surface scaled to extent 1.
"""

import dataclasses

import numpy as np

from shipshape import raster
from shipshape.raster import ImageFrame
from shipshape.stages import projection
from shipshape.types import ImageMethod, ReferenceBox
from shipshape_lab.metrics import CompleteSurface, chamfer_l1
from shipshape_lab.simulator.catalogue import DEFAULT
from shipshape_lab.simulator.surface import sample_surface

POINTS = 8192


def candidates(method: ImageMethod, box: ReferenceBox, longest: float) -> dict[str, ImageFrame]:
    """The image of one side-view method under each reading of its layers."""
    beam = projection.paper_frame(method, box, longest)
    half = (beam.upper[0] - beam.lower[0]) / 2
    cube = dataclasses.replace(beam, lower=(*beam.lower[:2], -half), upper=(*beam.upper[:2], half))
    return {"height": dataclasses.replace(beam, edges=(0.0, 1.0)), "cube": cube, "beam": beam}


def lifted(surface: np.ndarray, frame: ImageFrame) -> np.ndarray:
    """The surface after projection and lifting, (m, 3)."""
    layers = raster.rasterise(surface, frame)
    layer, row, column = np.nonzero(layers.count)
    depth = layers.top[layer, row, column]
    return raster.to_metres(column.astype(np.float32) + 0.5, row.astype(np.float32) + 0.5, depth, frame)


def main(argv: list[str] | None = None) -> None:
    """Print the table."""
    boxes = DEFAULT.boxes()
    longest = max(box.length for box in boxes)
    print(f"{'method':<10} {'vessel':<14} {'height':>8} {'cube':>8} {'beam':>8}   (CD-L1 x 1000)")
    for method in (ImageMethod.FULL_SIDE, ImageMethod.Z_SIDE):
        rows = []
        for name, box in zip(DEFAULT.names, boxes, strict=True):
            surface = sample_surface(DEFAULT.build(name), POINTS, np.random.default_rng(1))
            truth = CompleteSurface(surface, float(np.ptp(surface, axis=0).max()))
            frames = candidates(method, box, longest).values()
            rows.append([1000 * chamfer_l1(truth.nearest(lifted(surface, frame))) for frame in frames])
            print(f"{method:<10} {name:<14} " + " ".join(f"{value:8.1f}" for value in rows[-1]))
        print(f"{method:<10} {'mean':<14} " + " ".join(f"{value:8.1f}" for value in np.mean(rows, axis=0)))


if __name__ == "__main__":
    main()
