"""The command line: shipshape serve | classify | batch | check | bundle verify | loadtest | token | admin.

Exit codes: 0 all went well; 1 a cluster or file was refused, or the service failed; 2 the command, a setting
or the bundle is wrong. Of loadtest: 0 the budget was held; 1 it was not; 2 as above, or no target; 3 the tool was
too slow to tell.
"""

import argparse
import importlib.metadata
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn, TypeAlias

from shipshape.cli_batch import BATCH_NOTES, add_batch_arguments
from shipshape.errors import ShipshapeError
from shipshape.types import ImageMethod, Preset

OK, UNUSABLE, INTERRUPTED = 0, 2, 130

_NOTES = """\
examples:
  shipshape classify examples/contact.pcd --sensor-height 3 --png out    # a file, and its picture
  shipshape serve                                                        # the service, on loopback

`shipshape COMMAND --help` says more of each, with an example
"""

_CLASSIFY_NOTES = """\
examples:
  shipshape classify contact.pcd --sensor-height 3.2 --png out
  shipshape classify scan.npz --sensor-height 3.2 --json | jq .vessel

files (metres, level frame: origin at the LiDAR, x ahead, y to port, z up):
  .npy (N, 3)   .npz `points` (sum N, 3) and `n`, points a cluster   .csv .xyz   .pcd   .ply
  with the extra shipshape[batch] also .las .laz .parquet

--json prints one object a cluster and line:
  file, index           where the cluster came from
  vessel, probability, probabilities, unknown
  reasons               why to trust it less: few_points, end_on, occluded, bow_uncertain, out_of_catalogue
  heading, heading_std  radians, counter-clockwise from ahead; bow_probability that it is not the opposite
  aspect_deg            0 bow-on, 90 abeam, 180 stern-on
  box                   center (level frame), length, beam, height; metres
  measured_points, inferred_points, rung, bundle, stage_ms
  true_heading_deg      only with --own-heading; clockwise from north
  or file, index (null: the whole file) and error for what is refused
"""

_LOADTEST_NOTES = """\
examples:
  shipshape loadtest grpc://127.0.0.1:50051 --budget p99=50ms --rate 300
  shipshape loadtest http://127.0.0.1:8080 --sweep --report sweep.html
  shipshape loadtest oip+http://127.0.0.1:8080/shipshape --points 50=2,300=8,2000

targets:
  grpc[s]://HOST:PORT             shipshape.v1, a call a request
  grpc[s]+stream://HOST:PORT      shipshape.v1, a message of RecogniseStream a request
  http[s]://HOST:PORT             REST
  oip+http[s]://HOST:PORT/MODEL   Open Inference Protocol v2: any server that takes `points` and `counts`
  oip+grpc[s]://HOST:PORT/MODEL   the same over gRPC

exit codes: 0 the budget was held, 1 it was not, 2 wrong command or no target, 3 the tool was too slow to tell
times are written as 50ms, 2s or 1m
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    arguments = build_parser().parse_args(argv)
    try:
        code = _command(arguments.command)(arguments)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # The reader has seen enough (`| head`); Python must find nothing to flush at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except KeyboardInterrupt:
        return INTERRUPTED
    except ShipshapeError as error:
        print(f"shipshape: {error}", file=sys.stderr)
        return UNUSABLE


def _command(name: str) -> Callable[[argparse.Namespace], int]:
    """What carries it out; its libraries take up to a second to import, for which --help must not wait."""
    if name == "serve":
        from shipshape.serve import serve  # noqa: PLC0415

        return serve
    from shipshape.commands import COMMANDS  # noqa: PLC0415

    return COMMANDS[name]


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands; `arguments.command` names the one chosen."""
    parser = _Parser(
        prog="shipshape",
        description="Recognises and restores vessels from sparse LiDAR clusters.",
        epilog=_NOTES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=importlib.metadata.version("shipshape"))
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    _add_serve(commands)
    _add_classify(commands)
    _add_batch(commands)
    _add_check(commands)
    _add_bundle(commands)
    _add_loadtest(commands)
    _add_token(commands)
    _add_admin(commands)
    return parser


class _Parser(argparse.ArgumentParser):
    """Says what to do next beside what is wrong."""

    def error(self, message: str) -> NoReturn:
        """Exit with 2."""
        super().error(f"{message}; see `{self.prog} --help`")


_Commands: TypeAlias = "argparse._SubParsersAction[_Parser]"


def _add(commands: _Commands, name: str, summary: str, notes: str) -> _Parser:
    return commands.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=notes,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def _add_serve(commands: _Commands) -> None:
    notes = "example:\n  shipshape serve --rest-port 8080 --grpc-port 50051\n\n" + (
        "Each option and every limit of a request is also a variable: SHIPSHAPE_REST_PORT=8080 shipshape serve"
    )
    parser = _add(commands, "serve", "open the gRPC and REST doors until SIGTERM", notes)
    parser.set_defaults(command="serve")
    parser.add_argument("--host", help="address to listen on (default: loopback)")
    parser.add_argument("--rest-port", type=int, help="0 picks a free one")
    parser.add_argument("--grpc-port", type=int, help="0 picks a free one")
    parser.add_argument("--workers", type=int, help="processes or threads that compute; 0 is one a core")
    _add_bundle_option(parser)


def _add_classify(commands: _Commands) -> None:
    parser = _add(commands, "classify", "recognise the clusters in files", _CLASSIFY_NOTES)
    parser.set_defaults(command="classify")
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--json", action="store_true", help="one JSON object a cluster and line")
    parser.add_argument(
        "--png", type=Path, metavar="DIR", help="draw a picture of each cluster into DIR, as NAME.png"
    )
    _add_how(parser)


def _add_batch(commands: _Commands) -> None:
    parser = _add(commands, "batch", "recognise whole recordings into one table and a report", BATCH_NOTES)
    parser.set_defaults(command="batch")
    add_batch_arguments(parser)
    _add_how(parser)


def _add_how(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--preset", type=Preset, choices=list(Preset), default=Preset.BEST)
    parser.add_argument(
        "--image-method", type=ImageMethod, choices=list(ImageMethod), help="with --preset paper alone"
    )
    parser.add_argument("--sensor-height", type=float, metavar="M", help="LiDAR above the water, metres")
    parser.add_argument(
        "--own-heading", type=float, metavar="DEG", help="own true heading, degrees clockwise from north"
    )
    _add_bundle_option(parser)


def _add_check(commands: _Commands) -> None:
    notes = "example:\n  shipshape check --bundle models"
    summary = "dry run: verify the bundle and time every stage, no port opened"
    parser = _add(commands, "check", summary, notes)
    parser.set_defaults(command="check")
    _add_bundle_option(parser)


def _add_bundle(commands: _Commands) -> None:
    bundle = _add(commands, "bundle", "work on model bundles", "example:\n  shipshape bundle verify models")
    actions = bundle.add_subparsers(metavar="ACTION", required=True)
    summary = "compare every file of a bundle with its manifest"
    verify = _add(actions, "verify", summary, "example:\n  shipshape bundle verify models")
    verify.set_defaults(command="bundle verify")
    verify.add_argument("folder", type=Path, metavar="DIR")


def _add_loadtest(commands: _Commands) -> None:
    parser = _add(commands, "loadtest", "test whether a running service holds a latency budget", _LOADTEST_NOTES)
    parser.set_defaults(command="loadtest")
    parser.add_argument("target", metavar="TARGET", help="see below")
    parser.add_argument(
        "--budget", default="p99=50ms", help="share of requests and their limit (default: %(default)s)"
    )
    parser.add_argument("--rate", type=float, metavar="N", help="contacts a second (default: 100, or as recorded)")
    parser.add_argument("--sweep", action="store_true", help="find the highest rate that holds, from --rate on")
    parser.add_argument(
        "--step", default="5s", metavar="TIME", help="of each rate of a sweep (default: %(default)s)"
    )
    parser.add_argument("--duration", default="30s", metavar="TIME", help="of what counts (default: %(default)s)")
    parser.add_argument(
        "--warmup",
        default="3s",
        metavar="TIME",
        help="sent before, not counted; 0s: nothing (default: %(default)s)",
    )
    _add_load_options(parser)
    parser.add_argument("--ca", type=Path, metavar="PEM", help="who signed the target's certificate")
    parser.add_argument("--cert", type=Path, metavar="PEM", help="own certificate, for a target that asks for one")
    parser.add_argument("--key", type=Path, metavar="PEM", help="its key")
    parser.add_argument("--token-file", type=Path, metavar="FILE", help="holds the bearer token")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there")
    parser.add_argument("--report", type=Path, metavar="FILE", help="write a page with plots there")


def _add_load_options(parser: argparse.ArgumentParser) -> None:
    load = parser.add_argument_group("what is sent")
    load.add_argument(
        "--arrivals", default="poisson", help="poisson, constant, bursts:N, or a .csv of seconds,contacts"
    )
    load.add_argument(
        "--contacts", type=int, default=1, metavar="N", help="of each request (default: %(default)s)"
    )
    load.add_argument(
        "--points", metavar="LIST", help="of a contact, with weights: 50=2,300=8,2000 (default: 300)"
    )
    load.add_argument("--lanes", metavar="LIST", help="with weights: collision,tracking=8 (default: tracking)")
    load.add_argument("--clusters", type=Path, metavar="FILE", help="to cut contacts from (default: built in)")
    load.add_argument("--deadline", metavar="TIME", help="of each request (default: the budget's limit)")
    load.add_argument(
        "--connections", type=int, default=4, metavar="N", help="of a process (default: %(default)s)"
    )
    load.add_argument("--processes", type=int, default=1, metavar="N", help="that send (default: %(default)s)")
    load.add_argument(
        "--max-outstanding",
        type=int,
        default=10_000,
        metavar="N",
        help="beyond, nothing is sent (default: %(default)s)",
    )
    load.add_argument("--seed", type=int, default=0, help="of all that is drawn (default: %(default)s)")


def _add_token(commands: _Commands) -> None:
    notes = "example:\n  shipshape token fleet    # what to do with the two lines: docs/security.md"
    parser = _add(commands, "token", "make a bearer token, and its line for SHIPSHAPE_TOKENS_FILE", notes)
    parser.set_defaults(command="token")
    parser.add_argument("name", metavar="NAME", help="of the client that will hold it")


def _add_admin(commands: _Commands) -> None:
    notes = "example:\n  shipshape admin swap models-2 --token-file admin.token"
    admin = _add(commands, "admin", "look after a running service through its admin door", notes)
    calls = admin.add_subparsers(metavar="CALL", required=True)
    for call, summary in {
        "status": "print its state, its bundles and its counts",
        "swap": "try another bundle out and let it answer",
        "rollback": "let the bundle before the running one answer again",
        "shadow": "compare another bundle's answers with those of the running one",
        "unshadow": "unload the shadow",
        "promote": "let the shadow answer",
        "drain": "not ready any more, still answering",
        "resume": "ready again",
    }.items():
        of_bundle = call in ("swap", "shadow")
        folder = " models-2" if of_bundle else ""
        parser = _add(calls, call, summary, f"example:\n  shipshape admin {call}{folder}")
        parser.set_defaults(command="admin", call=call)
        parser.add_argument("--url", default="http://127.0.0.1:9090", help="default: %(default)s")
        parser.add_argument(
            "--token-file", type=Path, default=Path("admin.token"), help="holds the token (default: %(default)s)"
        )
        if of_bundle:
            parser.add_argument("folder", type=Path, metavar="DIR", help="below the service's bundle_root")


def _add_bundle_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--bundle", type=Path, metavar="DIR", help="model bundle (default: SHIPSHAPE_BUNDLE or models)"
    )
