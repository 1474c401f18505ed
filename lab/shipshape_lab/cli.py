"""shipshape-lab: simulate, train, evaluate. Every command is also a module that can be run with python -m."""

import importlib
import sys

COMMANDS = {
    "render": ("shipshape_lab.simulator.render", "picture of the simulated vessels beside real hulls"),
    "data": ("shipshape_lab.simulator.datasets", "make a data set: train, validation, P, H, far or U"),
    "train": ("shipshape_lab.training.train_all", "make the default bundle from nothing"),
    "fleet": ("shipshape_lab.fleet.command", "a verified bundle and its report of your own meshes"),
    "bundle": ("shipshape_lab.training.build_bundle", "calibrate trained networks and write their bundle"),
    "evaluate": ("shipshape_lab.experiments.evaluate", "recognition on a test set: P, far, H or U"),
    "restoration": ("shipshape_lab.experiments.restoration", "restoration on P or H"),
    "peers": ("shipshape_lab.peers.train", "train one competitor in naming vessels on the same data"),
    "completers": ("shipshape_lab.completion.train", "train one competitor in completing clouds on the same data"),
    "flow": ("shipshape_lab.generative.train", "train the generative restorer"),
    "flow-bundle": ("shipshape_lab.generative.bundle", "a bundle that restores by the generative restorer"),
    "generative": ("shipshape_lab.experiments.generative", "the generative restorer beside the deterministic one"),
    "headings": ("shipshape_lab.experiments.heading_peers", "heading by the paper's search, rectangles and best"),
    "modelnet": ("shipshape_lab.experiments.modelnet", "the paper's Experiment 1, on ModelNet40 shapes"),
    "experiment2": ("shipshape_lab.experiments.experiment_2", "the paper's Experiment 2, trained both ways"),
    "ablation": ("shipshape_lab.experiments.ablation", "accuracy over r and d_min"),
    "ladder": ("shipshape_lab.experiments.ladder", "what the answers given when time is short are worth"),
    "reasons": ("shipshape_lab.experiments.reasons", "what reason codes and the heading's spread are worth"),
    "restore-ms": ("shipshape_lab.experiments.restore_ms", "milliseconds beside PCN and SnowflakeNet"),
    "real": ("shipshape_lab.experiments.real_hulls", "what a bundle says of real hulls from mesh files"),
    "report": ("shipshape_lab.experiments.report", "tables and figures from the results"),
}


def main(argv: list[str] | None = None) -> int:
    """Run one command; `shipshape-lab COMMAND --help` explains it."""
    arguments = sys.argv[1:] if argv is None else argv
    if not arguments or arguments[0] not in COMMANDS:
        print("usage: shipshape-lab COMMAND [options]; example: shipshape-lab data P --out runs/data\n")
        print("\n".join(f"  {name:<12} {what}" for name, (_, what) in COMMANDS.items()))
        return 0 if arguments and arguments[0] in ("-h", "--help") else 2
    module, _ = COMMANDS[arguments[0]]
    importlib.import_module(module).main(arguments[1:])
    return 0


if __name__ == "__main__":
    sys.exit(main())
