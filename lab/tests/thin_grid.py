"""Three cells of the paper grid, and a fourth cluster with too few points to be answered."""

from shipshape_lab.simulator import datasets
from shipshape_lab.simulator.clusters import ClusterSet, collect

CELLS = (8 * 360 + 40, 4 * 360 + 200, 3240 + 8 * 360)  # a far and a middling rhib, a far pilot boat bow-on


def thin_grid() -> ClusterSet:
    job = datasets.Job("P", len(CELLS), 3)
    scans = [datasets.grid_cluster(job, cell) for cell in CELLS]
    thin, sensor = scans[0]
    scans.append((thin.__class__(**{**vars(thin), "points_level": thin.points_level[:4]}), sensor))
    return collect(scans, job.catalogue, job.seed)
