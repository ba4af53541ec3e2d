"""The command `garment-sim`: picks the sub-command and turns errors into exit codes."""

import argparse
import importlib
import json
import signal
import sys
import threading
from collections.abc import Sequence
from typing import NoReturn

from garment_sim_ros.ending import end_process
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.version import VERSION

COMMANDS = {
    "demo": "run a dressed, moving avatar over ROS 2; record, measure and draw it",
    "dress": "cut garments from patterns, sew them on a body and let them drape",
    "export": "turn a recorded avatar into a file for Blender and others",
    "fit": "fit colliders to a body",
    "info": "tell what would be modelled for an avatar and its outfit, and why",
    "run": "run dressed avatars over ROS 2, all nodes in one process",
    "simulate": "dress a clip or a recording without nodes, faster than real time",
    "stability": "drive the solvers to extremes and tell where they hold",
    "tradeoff": "measure speed against accuracy, setting by setting",
    "view": "show a running or a recorded avatar on a page in the browser",
}
"""Each is a module beside this one with `EXAMPLE`, `add_arguments(parser)`, and `run(args)`, which
returns what `--json` prints. Only the one that is called is loaded."""

DONE, UNUSABLE, INTERRUPTED = 0, 2, 130


class _Parser(argparse.ArgumentParser):
    """Reports wrong usage in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(UNUSABLE, f"error: {message}; allowed: see {self.prog} --help\n")


def parser(command: str | None) -> argparse.ArgumentParser:
    """The parser of the command line, with the options of one command."""
    top = _Parser(
        prog="garment-sim",
        description="Dresses a moving avatar in real time.",
        epilog="example: garment-sim demo",
    )
    top.add_argument("--version", action="version", version=f"garment-sim {VERSION}")
    top.add_argument("--json", action="store_true", help="print the result as JSON, last line")
    commands = top.add_subparsers(dest="command", metavar="command", required=True)
    for name, text in COMMANDS.items():
        sub = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        if name == command:
            module = importlib.import_module(f"garment_sim_ros.cli.{name}")
            module.add_arguments(sub)
            sub.add_argument(
                "--json",
                action="store_true",
                default=argparse.SUPPRESS,  # what stands before the command holds
                help="print the result as JSON, last line",
            )
            sub.epilog = f"example: {module.EXAMPLE}"
            sub.set_defaults(run=module.run)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: Arguments without the program's name; None for those of the process.

    Returns:
        0 done, 2 wrong usage or unusable input, 130 interrupted.
    """
    if argv is None:
        return end_process(_run(sys.argv[1:]))
    return _run(list(argv))


def _run(words: list[str]) -> int:
    """Run one command; returns its exit code."""
    if threading.current_thread() is threading.main_thread():
        # A polite end cleans up as Ctrl-C does.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        args = parser(next((word for word in words if word in COMMANDS), None)).parse_args(words)
        result = args.run(args)
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else UNUSABLE
    except KeyboardInterrupt:
        return INTERRUPTED
    except GarmentSimError as error:
        print(f"error: {' '.join(str(error).split())}", file=sys.stderr)
        return UNUSABLE
    if args.json:
        print(json.dumps(result, allow_nan=False))
    return DONE


if __name__ == "__main__":
    sys.exit(main())
