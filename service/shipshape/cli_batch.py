"""The arguments of `shipshape batch`."""

import argparse
from pathlib import Path

BATCH_NOTES = """\
examples:
  shipshape batch night/ --out results --sensor-height 3.2
  shipshape batch harbour.mcap --out results --segment --topic /lidar/points
  shipshape batch night/ --out results-2 --bundle models-2 --compare results

inputs: files, or folders of them
  clusters or whole scans  .pcd .ply .las .laz .npy .csv .xyz .parquet
  many clusters            .npz, or a column of ids in any of the others: contact_id, track_id, cluster_id
  recordings               .bag, .mcap of ROS 1 and ROS 2, .db3 or its folder; topics of PointCloud2

results: contacts.parquet, a row a contact; report.html; summary.json; docs/batch.md says what the columns are
A run that was stopped, in whatever way, goes on where it was when the same command is given again.

exit codes: 0 all inputs were read, 1 some were refused or damaged, 2 wrong command, bundle or folder of results
"""


def add_batch_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what no other command has."""
    parser.add_argument("inputs", nargs="+", type=Path, metavar="INPUT", help="file or folder; see below")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of results")
    parser.add_argument("--compare", type=Path, metavar="OLD", help="tell what changed since these results")
    parser.add_argument("--restored", action="store_true", help="write restored clouds too, into DIR/clouds")
    parser.add_argument("--topic", action="append", metavar="NAME", help="of recordings (default: all clouds)")
    parser.add_argument("--id-field", metavar="NAME", help="column, field or array that names clusters")
    scans = parser.add_argument_group("whole scans")
    scans.add_argument("--segment", action="store_true", help="split scans into clusters")
    scans.add_argument("--gap", type=float, metavar="M", help="between two vessels at least (default: 4)")
    scans.add_argument("--water-band", type=float, metavar="M", help="above the water, left out (default: 0.5)")
    scans.add_argument("--own-length", type=float, metavar="M", help="of one's own vessel, left out (default: 20)")
    scans.add_argument("--own-beam", type=float, metavar="M", help="of the same (default: 8)")
    scans.add_argument("--min-points", type=int, metavar="N", help="of a cluster at least (default: 10)")
    where = parser.add_argument_group("where it is computed")
    where.add_argument("--workers", type=int, metavar="N", help="processes (default: one a core)")
    where.add_argument("--ray", metavar="ADDRESS", help="of a Ray cluster, or `local`; needs shipshape[ray]")
    where.add_argument("--service", metavar="URL", help="of a running service, grpc://HOST:PORT: its batch lane")
    where.add_argument("--ca", type=Path, metavar="PEM", help="who signed the certificate of the service")
    where.add_argument("--cert", type=Path, metavar="PEM", help="own certificate, for a service that asks for one")
    where.add_argument("--key", type=Path, metavar="PEM", help="its key")
    where.add_argument("--token-file", type=Path, metavar="FILE", help="holds the bearer token for the service")
